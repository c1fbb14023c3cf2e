/// The execution order of the steps of a Tape.
#pragma once

#include <vector>

namespace variator_sim::expression {

/// One future instruction. Step i computes node i, and the other nodes in `results`.
struct Step {
  int code = -1;  ///< -1: a constant, a variable, or part of another's instruction
  int results[4] = {-1, -1, -1, -1};
  int operands[4] = {-1, -1, -1, -1};
  int operand_count = 0;
};

/// Orders all steps that have a code. Operands come before their readers, the step on the longest
/// remaining chain first, with ready steps of the same code: one jump then leads to several
/// instructions (kLongestRun).
std::vector<int> schedule(const std::vector<Step>& steps);

}  // namespace variator_sim::expression
