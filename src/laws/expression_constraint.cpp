// A constraint that the scene states as a formula; its derivatives are exact.
//
// Keys: `order` (1, 2 or 3), `expression` (f, psi or C eta + c0, in its own unit; names t, phi1..,
// w1.., from order 2 on e1.., in order 3 j1.. linearly, those with the names of shafts, inputs,
// tables and the parameters), `parameters` (optional dictionary of numbers). It must depend on its
// highest derivatives: w, e or j.
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/laws.h"

namespace variator_sim {

using expression::FormulaKind;
using expression::Source;

void ExpressionConstraint::build(LawContext& scene) {
  struct Order {
    FormulaKind kind;
    Source highest;
    const char* name;
  };
  static constexpr Order kOrders[] = {
      {FormulaKind::kOrder1, Source::kVelocity, "a velocity (w1.. of the shafts)"},
      {FormulaKind::kOrder2, Source::kAcceleration, "an acceleration (e1.. of the shafts)"},
      {FormulaKind::kOrder3, Source::kJerk, "a jerk (j1.. of the shafts)"}};
  expression::Graph& graph = *scene.component().graph();
  const int number = scene.parameters().integer("order", 1, 3);
  const Order& order = kOrders[number - 1];
  const expression::Node psi = readFormula(scene.component(), "expression", order.kind, graph);
  scene.tellOf("expression");
  bool depends = false;
  for (int i = 0; i < scene.component().shaftCount(); ++i) {
    const expression::Node C = graph.differentiate(psi, slotOf(order.highest, i));
    depends = depends || !graph.isConstant(C, 0.0);
  }
  if (!depends) {
    throw SceneError(scene.place(), "the constraint is not of order " + std::to_string(number) +
                                        ": " + inQuotes(scene.parameters().formula("expression")) +
                                        " does not depend on " + order.name);
  }
  scene.constrain({graph, psi});
}

}  // namespace variator_sim
