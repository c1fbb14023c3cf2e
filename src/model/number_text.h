/// Doubles to text and back. No locale changes what is read and written.
#pragma once

#include <charconv>
#include <clocale>
#include <string>
#include <system_error>

namespace variator_sim {

/// While it lives, printf and strtod of its thread know the decimal point as a dot, whatever
/// setlocale was told.
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

/// Reads a text that is a number from its beginning to its end. False for others.
inline bool readWhole(const std::string& text, double* value) {
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, *value);
  return error == std::errc() && rest == end;
}

}  // namespace variator_sim
