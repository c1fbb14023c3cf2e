/// What all targets ask of texts for users.
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

/// What users are told may hold anything but what is promised of it.
inline void check(const std::string& message) {
  if (message.size() <= kLongestMessage + 100 && isPresentable(message, "\n")) return;
  std::fprintf(stderr, "not presentable: %s\n", message.c_str());
  std::abort();
}

}  // namespace variator_sim::fuzz
