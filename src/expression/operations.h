/// The functions that formulas can call.
#pragma once

#include <optional>
#include <string>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

struct Function {
  const char* name;
  int argument_count;
  Operation operation;  ///< kConstant for `clamp`, which is made of two
  const char* latex;
};

/// Returns the function of that name. parser.h has the list of names.
std::optional<Function> findFunction(const std::string& name);
/// Returns the function of an operation.
std::optional<Function> findFunction(Operation operation);

/// Explains the formula's equivalent of a `word` of other languages ("and", "integral"), or "".
std::string explainForeignWord(const std::string& word);

}  // namespace variator_sim::expression
