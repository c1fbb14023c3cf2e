// A constraint that the scene states as a formula; its derivatives are exact.
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/laws.h"

namespace variator_sim {

using expression::FormulaKind;
using expression::Source;

namespace {

void readReaction(LawContext& scene) {
  ParameterReader section = scene.parameters().section("reaction");
  bool acts = false;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const std::string& shaft = scene.shaftNames()[static_cast<std::size_t>(i)];
    section.allow(shaft);
    if (!section.has(shaft)) continue;
    const Expression D = scene.quantity(section, shaft, Range::any(), {});
    acts = acts || !D.isConstant() || D.value() != 0.0;
    scene.react(scene.shaftAt(i), D);
  }
  section.finish();
  if (acts) return;
  throw scene.parameters().error(
      "reaction", "acts on no shaft; allowed: {SHAFT: FORMULA, ..} with one that is not 0");
}

}  // namespace

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
  expression::Graph& graph = *scene.graph();
  scene.keys({"reaction"});
  const int number = scene.parameters().integer("order", 1, 3);
  const Order& order = kOrders[number - 1];
  const expression::Node psi = readFormula(scene, "expression", order.kind, graph);
  scene.tellOf("expression");
  bool depends = false;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    const expression::Node C = graph.differentiate(psi, slotOf(order.highest, i));
    depends = depends || !graph.isConstant(C, 0.0);
  }
  if (!depends) {
    throw SceneError(scene.place(), "the constraint is not of order " + std::to_string(number) +
                                        ": " + inQuotes(scene.parameters().formula("expression")) +
                                        " does not depend on " + order.name);
  }
  scene.constrain({graph, psi});
  if (scene.parameters().has("reaction")) readReaction(scene);
}

}  // namespace variator_sim
