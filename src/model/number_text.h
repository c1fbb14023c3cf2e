/// Doubles to text and back, as std::to_chars and std::from_chars do, where the library has them
/// for doubles; GCC's has from version 11 on. No locale changes what they read and write.
#pragma once

#include <charconv>
#include <clocale>

#if defined(_GLIBCXX_RELEASE) && _GLIBCXX_RELEASE < 11
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#define VARIATOR_SIM_OWN_NUMBER_TEXT
#endif

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

#ifndef VARIATOR_SIM_OWN_NUMBER_TEXT

/// The fewest digits that read back to the same double.
inline std::to_chars_result numberToChars(char* first, char* last, double value) {
  return std::to_chars(first, last, value);
}
/// So many significant digits.
inline std::to_chars_result numberToChars(char* first, char* last, double value, int digits) {
  return std::to_chars(first, last, value, std::chars_format::general, digits);
}
inline std::from_chars_result numberFromChars(const char* first, const char* last, double& value) {
  return std::from_chars(first, last, value);
}

#else

inline std::to_chars_result copyChars(const char* text, char* first, char* last) {
  const std::size_t size = std::strlen(text);
  if (size > static_cast<std::size_t>(last - first)) return {last, std::errc::value_too_large};
  std::memcpy(first, text, size);
  return {first + size, std::errc()};
}

inline std::to_chars_result numberToChars(char* first, char* last, double value, int digits) {
  const DotLocale dot;
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return copyChars(text, first, last);
}

/// Of the plain and the scientific form the shorter one, the plain one if they are equally long.
inline std::to_chars_result numberToChars(char* first, char* last, double value) {
  const DotLocale dot;
  char scientific[40];
  int decimals = 0;
  do {
    std::snprintf(scientific, sizeof scientific, "%.*e", decimals, value);
  } while (std::isfinite(value) && std::strtod(scientific, nullptr) != value && ++decimals < 17);
  if (!std::isfinite(value)) return copyChars(scientific, first, last);
  const int exponent = std::atoi(std::strchr(scientific, 'e') + 1);
  if (exponent < -10 || exponent > 30) return copyChars(scientific, first, last);
  char plain[80];
  std::snprintf(plain, sizeof plain, "%.*f", decimals > exponent ? decimals - exponent : 0, value);
  const bool is_plain = std::strlen(plain) <= std::strlen(scientific);
  return copyChars(is_plain ? plain : scientific, first, last);
}

inline std::from_chars_result numberFromChars(const char* first, const char* last, double& value) {
  const DotLocale dot;
  const std::string text(first, last);
  const char* digits = text.c_str();
  if (*digits == '-') ++digits;
  const bool is_hexadecimal = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X');
  if (*digits == '+' || *digits == '-' || std::isspace(static_cast<unsigned char>(*digits)) != 0) {
    return {first, std::errc::invalid_argument};
  }
  if (is_hexadecimal) {  // the 0 is a number, the x is not
    value = text[0] == '-' ? -0.0 : 0.0;
    return {first + (digits - text.c_str()) + 1, std::errc()};
  }
  char* end = nullptr;
  const double read = std::strtod(text.c_str(), &end);
  if (end == text.c_str()) return {first, std::errc::invalid_argument};
  const char* const stop = first + (end - text.c_str());
  const std::string mantissa(digits, std::strcspn(digits, "eE"));
  const bool is_zero = mantissa.find_first_of("123456789") == std::string::npos;
  const bool is_named = std::isalpha(static_cast<unsigned char>(*digits)) != 0;
  if ((std::isinf(read) && !is_named) || (read == 0.0 && !is_zero)) {
    return {stop, std::errc::result_out_of_range};
  }
  value = read;
  return {stop, std::errc()};
}

#endif

}  // namespace variator_sim
