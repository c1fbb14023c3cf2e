#include "variator_sim/output.h"

#include <stdexcept>

#include "variator_sim/expression/parser.h"

namespace variator_sim {

Output::Output(ComponentContext& context) : name_(context.name()) {
  constexpr const char* kKey = "expression";
  expression::Graph& graph = *context.graph();
  node_ = readFormula(context, kKey, expression::FormulaKind::kOutput, graph);
  try {
    formula_ = expression::Tape(graph, {node_});
  } catch (const std::length_error& error) {
    throw SceneError(context.parameters().keyPath(kKey), error.what());
  }
}

}  // namespace variator_sim
