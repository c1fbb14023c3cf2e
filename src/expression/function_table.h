/// The functions that formulas can call.
#pragma once

#include <string>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

struct Function {
  const char* name;
  int argument_count;
  /// Makes the node from its arguments; null for `if`, whose first argument is no value.
  Node (*make)(Graph& graph, const Node* arguments);
};

/// Returns the function of that name, or nullptr. parser.h has the list of names.
const Function* findFunction(const std::string& name);

/// Explains the formula's equivalent of a `word` of other languages ("and", "integral"), or "".
std::string explainForeignWord(const std::string& word);

}  // namespace variator_sim::expression
