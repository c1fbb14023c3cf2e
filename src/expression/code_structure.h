/// The structure of generated C.
#pragma once

#include <vector>

namespace variator_sim::expression {

/// It excludes numbers, which the code reads from an array, so that formulas which differ in
/// numbers alone share their code.
struct CodeStructure {
  std::vector<int> words;         ///< equal words mean the same C
  std::vector<double> constants;  ///< values of the code's array

  /// Notes a number; returns true when the code holds it as a literal, and not the array.
  bool note(double value);
};
/// True for 0, 1 and -1, which are literals in the code: a compiler simplifies their operations.
bool isWrittenOut(double value);

}  // namespace variator_sim::expression
