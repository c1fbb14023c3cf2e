#include "variator_sim/output.h"

#include "variator_sim/expression/parser.h"

namespace variator_sim {

Output::Output(ComponentContext& context) : name_(context.name()) {
  expression::Graph& graph = *context.graph();
  node_ = readFormula(context, "expression", expression::FormulaKind::kOutput, graph);
  formula_ = expression::Tape(graph, {node_});
}

}  // namespace variator_sim
