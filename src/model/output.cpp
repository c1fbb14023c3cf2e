#include "variator_sim/output.h"

#include "variator_sim/expression/parser.h"
#include "variator_sim/units.h"

namespace variator_sim {

Output::Output(ComponentContext& context) : name_(context.name()) {
  expression::Graph& graph = *context.graph();
  ParameterReader& reader = context.parameters();
  reader.allow("unit");
  value_ = readFormula(context, "expression", expression::FormulaKind::kOutput, graph);
  node_ = value_;
  if (reader.has("unit")) {
    unit_ = reader.text("unit");
    const Unit unit = requireUnit(unit_, reader.keyPath("unit"));
    if (unit.zero != 0.0) node_ = graph.subtract(node_, graph.constant(unit.zero));
    node_ = graph.divide(graph.multiply(node_, graph.constant(unit.denominator)),
                         graph.constant(unit.numerator));
  }
  formula_ = expression::Tape(graph, {node_});
}

}  // namespace variator_sim
