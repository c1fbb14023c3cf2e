/// The text of a formula while it is read: the next token, and errors with their column.
#pragma once

#include <cstddef>
#include <string>

#include "expression/characters.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim::expression {

/// `text` has to outlive it.
class FormulaText {
 public:
  explicit FormulaText(const std::string& text) : text_(text) {}

  /// Moves to `offset` or, from white space, to the token behind it, never in between.
  void moveTo(std::size_t offset) {
    position_ = offset;
    while (position_ < text_.size() && isSpace(text_[position_])) ++position_;
  }

  bool isAt(std::size_t offset, char c) const {
    return offset < text_.size() && text_[offset] == c;
  }
  bool isDigitAt(std::size_t offset) const {
    return offset < text_.size() && isDigit(text_[offset]);
  }

  bool accept(char c) {
    if (!isAt(position_, c)) return false;
    moveTo(position_ + 1);
    return true;
  }

  /// Returns the first position from `offset` on without a digit.
  std::size_t skipDigits(std::size_t offset) const {
    while (isDigitAt(offset)) ++offset;
    return offset;
  }

  /// Returns the end of the name that begins at `offset`.
  std::size_t endOfName(std::size_t offset) const {
    while (offset < text_.size() && (isNameStart(text_[offset]) || isDigit(text_[offset]))) {
      ++offset;
    }
    return offset;
  }

  bool beginsNumber(std::size_t offset) const {
    return isDigitAt(offset) || (isAt(offset, '.') && isDigitAt(offset + 1));
  }

  /// Returns the end of the number that begins at `offset`.
  std::size_t endOfNumber(std::size_t offset) const {
    std::size_t end = skipDigits(offset);
    if (isAt(end, '.')) end = skipDigits(end + 1);
    if (isAt(end, 'e') || isAt(end, 'E')) {
      const bool has_sign = isAt(end + 1, '+') || isAt(end + 1, '-');
      const std::size_t power = end + (has_sign ? 2 : 1);
      // Otherwise the letter is no part of the number, and number() reports the error.
      if (isDigitAt(power)) end = skipDigits(power);
    }
    return end;
  }

  [[noreturn]] void fail(std::size_t where, const std::string& message) const {
    throw ExpressionError(message, text_, columnOf(text_, where));
  }

  /// Returns the token at `where`: a name, a number or one character.
  std::string piece(std::size_t where) const {
    std::size_t end = where + 1;
    if (isNameStart(text_[where])) {
      end = endOfName(end);
    } else if (isDigit(text_[where])) {
      while (isDigitAt(end) || isAt(end, '.')) ++end;
    } else {
      while (end < text_.size() && continuesCharacter(text_[end])) ++end;
    }
    return text_.substr(where, end - where);
  }
  std::string describe(std::size_t where) const {
    return where == text_.size() ? "the end" : inQuotes(piece(where));
  }

 protected:
  const std::string& text_;
  std::size_t position_ = 0;
};

}  // namespace variator_sim::expression
