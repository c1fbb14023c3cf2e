// The structure of a SeriesProgram's C: equal structures have the same text.
#include <cmath>
#include <iterator>
#include <vector>

#include "expression/code_structure.h"
#include "expression/series_program.h"

namespace variator_sim::expression {

bool isWrittenOut(double value) {
  return (value == 0.0 && !std::signbit(value)) || value == 1.0 || value == -1.0;
}

bool CodeStructure::note(double value) {
  const bool is_written_out = isWrittenOut(value);
  words.push_back(is_written_out ? static_cast<int>(value) : 2);
  if (!is_written_out) constants.push_back(value);
  return is_written_out;
}

void SeriesProgram::addStructure(CodeStructure* structure) const {
  std::vector<int>& words = structure->words;
  const auto count = [&words](std::size_t n) { words.push_back(static_cast<int>(n)); };
  const auto add = [&](const std::vector<int>& numbers) {
    count(numbers.size());
    words.insert(words.end(), numbers.begin(), numbers.end());
  };
  add(degree_);
  for (const char is : accelerated_) count(is);
  for (const bool has : has_pole_) count(has ? 1 : 0);
  add(accelerations_);
  for (const std::vector<int>& program : programs_) add(program);
  // Every constant has its index, even if it is written out.
  const auto addConstant = [&](double value) {
    if (structure->note(value)) structure->constants.push_back(value);
  };
  count(terms_.size());
  for (const Term& term : terms_) {
    count(static_cast<std::size_t>(term.row));
    addConstant(term.factor);
  }
  count(instructions_.size());
  for (const Instruction& it : instructions_) {
    words.insert(words.end(), {static_cast<int>(it.code), it.result, it.aux[0], it.aux[1], it.state,
                               it.is_tried ? 1 : 0});
    words.insert(words.end(), std::begin(it.operands), std::end(it.operands));
    addConstant(it.constant);
  }
  count(pieces_.size());
  for (const Piece& piece : pieces_) {
    words.insert(words.end(), {piece.table != nullptr ? 1 : 2, piece.degree[0], piece.degree[1]});
  }
}

}  // namespace variator_sim::expression
