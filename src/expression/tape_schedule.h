/// The order in which the steps of a Tape are carried out.
#pragma once

#include <vector>

namespace variator_sim::expression {

/// What becomes one instruction. Step i computes node i, and what else is in `results`.
struct Step {
  int code = -1;  ///< -1: a constant, a variable, or part of another's instruction
  int results[4] = {-1, -1, -1, -1};
  int operands[4] = {-1, -1, -1, -1};
  int operand_count = 0;
};

/// All steps that have a code. Operands come before their readers, what the longest remaining chain
/// waits for goes first, and with it what has the same code and is ready, too: one jump then leads
/// to several instructions (kLongestRun).
std::vector<int> schedule(const std::vector<Step>& steps);

}  // namespace variator_sim::expression
