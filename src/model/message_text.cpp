#include "variator_sim/message_text.h"

#include <algorithm>
#include <array>
#include <cstdio>

namespace variator_sim {
namespace {

unsigned byteAt(const std::string& text, std::size_t i) {
  return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
}

/// Returns the number of bytes of the character at `i`; 0 unless one begins there that can be
/// shown: no control character (also above 0x7f: some terminals obey 0x9b), and valid UTF-8.
std::size_t lengthOfCharacter(const std::string& text, std::size_t i) {
  const unsigned first = byteAt(text, i);
  if (first < 0x80U) return first >= 0x20U && first != 0x7fU ? 1 : 0;
  if (first < 0xc2U || first > 0xf4U) return 0;
  const std::size_t length = first < 0xe0U ? 2 : first < 0xf0U ? 3 : 4;
  for (std::size_t k = 1; k < length; ++k) {
    if ((byteAt(text, i + k) & 0xc0U) != 0x80U) return 0;
  }
  const unsigned second = byteAt(text, i + 1);
  const bool is_control = first == 0xc2U && second < 0xa0U;
  const bool is_overlong = (first == 0xe0U && second < 0xa0U) || (first == 0xf0U && second < 0x90U);
  const bool is_none = (first == 0xedU && second > 0x9fU) || (first == 0xf4U && second > 0x8fU);
  return is_control || is_overlong || is_none ? 0 : length;
}

std::string escapeOf(unsigned byte) {
  if (byte == '\n') return "\\n";
  if (byte == '\t') return "\\t";
  if (byte == '\r') return "\\r";
  std::array<char, 8> escape{};
  std::snprintf(escape.data(), escape.size(), "\\x%02x", byte);
  return escape.data();
}

constexpr const char* kCut = "...";

std::string shown(const std::string& text, std::size_t most, bool keeps_lines) {
  std::string result;
  std::size_t whole = 0;  // the length that leaves room for the dots
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = lengthOfCharacter(text, i);
    if (length > 0) {
      result.append(text, i, length);
    } else if (keeps_lines && text[i] == '\n') {
      result += '\n';
    } else {
      result += escapeOf(byteAt(text, i));
    }
    i += std::max<std::size_t>(length, 1);
    if (result.size() > most) return result.substr(0, whole) + kCut;
    if (result.size() + 3 <= most) whole = result.size();
  }
  return result;
}

}  // namespace

std::string escaped(const std::string& text, std::size_t most) {
  return shown(text, most, false);
}

std::string inQuotes(const std::string& text) {
  return "'" + escaped(text) + "'";
}

std::string shownPath(const std::string& path) {
  constexpr std::size_t kLongestPath = 240;
  constexpr std::size_t kEnd = 100;
  if (path.size() <= kLongestPath) return escaped(path, 4 * kLongestPath);
  std::size_t end = path.size() - kEnd;
  while (end < path.size() && (byteAt(path, end) & 0xc0U) == 0x80U) ++end;
  return escaped(path, kLongestPath - kEnd) + escaped(path.substr(end), 4 * kEnd);
}

std::string presentable(const std::string& message) {
  return shown(message, kLongestMessage, true);
}

std::string joinNames(const std::vector<std::string>& names) {
  constexpr std::size_t kLongestList = 1500;
  std::string text;
  for (const std::string& name : names) {
    if (text.size() > kLongestList) return text + ", ... (" + std::to_string(names.size()) + ")";
    if (!text.empty()) text += ", ";
    text += escaped(name);
  }
  return text;
}

}  // namespace variator_sim
