/// Classes of characters in formulas. std::isalpha and its relatives depend on the locale.
#pragma once

#include <cstddef>
#include <string>

namespace variator_sim::expression {

inline bool isDigit(char c) {
  return c >= '0' && c <= '9';
}
inline bool isNameStart(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

inline bool isSpace(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f';
}

inline bool isControl(char c) {
  return (c >= 0 && c < ' ') || c == 0x7f;
}

/// True for the bytes that continue a UTF-8 character.
inline bool continuesCharacter(char c) {
  return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
}

/// Returns the column, from 1, of the character at `offset`.
inline int columnOf(const std::string& text, std::size_t offset) {
  int column = 1;
  for (std::size_t i = 0; i < offset && i < text.size(); ++i) {
    column += continuesCharacter(text[i]) ? 0 : 1;
  }
  return column;
}

}  // namespace variator_sim::expression
