#include "characters.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim::expression {

namespace {

/// Returns two lines: the text around `column`, cut to fit a terminal, and a caret below it.
std::string showPlace(const std::string& text, int column) {
  constexpr int kBefore = 50;
  constexpr int kAfter = 25;
  std::string shown;
  int position = 0;
  bool cut_before = false;
  bool cut_after = false;
  for (const char c : text) {
    position += continuesCharacter(c) ? 0 : 1;
    if (position < column - kBefore) {
      cut_before = true;
    } else if (position > column + kAfter) {
      cut_after = true;
    } else {
      shown += isControl(c) ? ' ' : c;  // one for one: the caret stands below
    }
  }
  const int indent = cut_before ? kBefore + 3 : column - 1;
  return "\n  " + std::string(cut_before ? "..." : "") + shown + (cut_after ? "..." : "") + "\n  " +
         std::string(static_cast<std::size_t>(indent), ' ') + "^";
}

}  // namespace

ExpressionError::ExpressionError(const std::string& message, const std::string& text, int column)
    : Error(message + " at column " + std::to_string(column) + showPlace(text, column)),
      column_(column) {}

}  // namespace variator_sim::expression
