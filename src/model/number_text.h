/// Converts doubles to text and back, independently of the locale.
#pragma once

#include <charconv>
#include <clocale>
#include <cstdio>
#include <string>
#include <system_error>

namespace variator_sim {

/// While it exists, printf and strtod of its thread use a dot as the decimal point, whatever
/// setlocale has set.
class DotLocale {
 public:
  DotLocale() : previous_(uselocale(locale())) {}
  ~DotLocale() { uselocale(previous_); }
  DotLocale(const DotLocale&) = delete;
  DotLocale& operator=(const DotLocale&) = delete;

 private:
  static locale_t locale() {
    static const locale_t dot = newlocale(LC_ALL_MASK, "C", nullptr);
    return dot;
  }
  locale_t previous_;
};

/// Returns what printf writes, with a dot as the decimal point, at most 511 characters.
template <class... Values>
std::string printed(const char* format, Values... values) {
  const DotLocale dot;
  char text[512];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// Reads a text that is a number from its beginning to its end. Returns false for others.
inline bool readWhole(const std::string& text, double* value) {
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, *value);
  return error == std::errc() && rest == end;
}

}  // namespace variator_sim
