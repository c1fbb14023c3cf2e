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
  for (int n = 0; n < kMaxObserved; ++n) {
    reads_principle_ = reads_principle_ || graph.dependsOn(node_, slotOf(n));
  }
  formula_ = expression::Tape(graph, {node_});
}

SceneSymbols Output::nameObserved(SceneSymbols symbols, const std::vector<std::string>& shafts,
                                  expression::Graph& graph) {
  symbols.of_elements = std::make_shared<std::set<std::string>>(*symbols.of_elements);
  const auto add = [&](const std::string& name, int n) {
    if (symbols.inputs.count(name) + symbols.played.count(name) != 0) return;  // the scene's own
    if (!symbols.values.emplace(name, graph.variable(slotOf(n))).second) return;
    symbols.of_elements->insert(name);
  };
  const int S = static_cast<int>(shafts.size());
  for (int i = 0; i < S; ++i) add("G_" + shafts[static_cast<std::size_t>(i)], i);
  add("Z", S);
  add("constraint_measure", S + 1);
  return symbols;
}

int Output::slotOf(int n) {
  return expression::slotOf(expression::Source::kInput, kFirstObserved + n);
}

}  // namespace variator_sim
