/// Checks of texts for users, common to all targets.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

#include "variator_sim/errors.h"

namespace variator_sim::fuzz {

/// Whether `text` holds no control character but those of `allowed`.
inline bool isPresentable(const std::string& text, const std::string& allowed) {
  for (const char c : text) {
    const bool is_control = (c >= 0 && c < ' ') || c == 0x7f;
    if (is_control && allowed.find(c) == std::string::npos) return false;
  }
  return true;
}

/// Messages to users may have any content within these promises.
inline void check(const std::string& message) {
  if (message.size() <= kLongestMessage + 100 && isPresentable(message, "\n")) return;
  std::fprintf(stderr, "not presentable: %s\n", message.c_str());
  std::abort();
}

}  // namespace variator_sim::fuzz
