#include "variator_sim/expression/parser.h"
#include "variator_sim/scene.h"
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
  for (int n = 0; n < kMaxObserved; ++n) {
    reads_principle_ = reads_principle_ || graph.dependsOn(node_, slotOf(n));
  }
  formula_ = expression::Tape(graph, {node_});
}

void Output::nameObserved(const std::vector<std::string>& shafts, expression::Graph& graph,
                          SceneSymbols* symbols) {
  const auto add = [&](const std::string& name, int n) {
    symbols->observed.emplace(name, [&graph, n] { return graph.variable(slotOf(n)); });
  };
  int n = 0;
  for (const std::string& shaft : shafts) add("G_" + shaft, n++);
  add("Z", n++);
  add("constraint_measure", n);
}

int Output::slotOf(int n) {
  return expression::slotOf(expression::Source::kInput, kFirstObserved + n);
}

}  // namespace variator_sim
