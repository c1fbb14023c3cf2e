/// Operations, and the functions that formulas can call.
#pragma once

#include <string>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

struct Function {
  Operation operation;  ///< kConstant for `clamp`, which is made of two
  int operand_count;
  double (*value)(const double* operands);  ///< null for what reads more than its operands
  const char* name = "";                    ///< in formulas, "" if there is none
  const char* latex = "";
  /// (A comparison is one argument.)
  int argumentCount() const { return operation == Operation::kSelect ? 3 : operand_count; }
};

/// Returns the function of that name, or null. parser.h has the list of names.
const Function* findFunction(const std::string& name);
const Function& functionOf(Operation operation);

/// Explains the formula's equivalent of a `word` of other languages ("and", "integral"), or "".
std::string explainForeignWord(const std::string& word);

}  // namespace variator_sim::expression
