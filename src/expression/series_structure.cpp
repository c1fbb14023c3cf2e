// The structure of a SeriesProgram's C: equal structures have the same text.
#include <cmath>
#include <iterator>
#include <vector>

#include "expression/series_program.h"

namespace variator_sim::expression {

bool isWrittenOut(double value) {
  return (value == 0.0 && !std::signbit(value)) || value == 1.0 || value == -1.0;
}

void SeriesProgram::addStructure(std::vector<int>* words) const {
  const auto count = [&words](std::size_t n) { words->push_back(static_cast<int>(n)); };
  const auto add = [&](const std::vector<int>& numbers) {
    count(numbers.size());
    words->insert(words->end(), numbers.begin(), numbers.end());
  };
  const auto addConstant = [&](double value) {
    words->push_back(isWrittenOut(value) ? static_cast<int>(value) : 2);
  };
  add(degree_);
  for (const char is : accelerated_) count(is);
  for (const bool has : has_pole_) count(has ? 1 : 0);
  add(accelerations_);
  count(terms_.size());
  for (const Term& term : terms_) {
    count(static_cast<std::size_t>(term.row));
    addConstant(term.factor);
  }
  count(instructions_.size());
  for (const Instruction& it : instructions_) {
    words->insert(words->end(), {static_cast<int>(it.code), it.result, it.aux[0], it.aux[1],
                                 it.state, it.is_tried ? 1 : 0});
    words->insert(words->end(), std::begin(it.operands), std::end(it.operands));
    addConstant(it.constant);
  }
  count(pieces_.size());
  for (const Piece& piece : pieces_) {
    words->insert(words->end(),
                  {piece.table != nullptr && piece.table->argumentCount() == 1 ? 1 : 2,
                   piece.degree[0], piece.degree[1]});
  }
}

}  // namespace variator_sim::expression
