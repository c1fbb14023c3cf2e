#include "analysis/trim_equations.h"

namespace variator_sim {

using expression::Node;

namespace {}  // namespace

std::vector<NamedFormula> makeBalance(MotionEquations& equations, const Scene& scene,
                                      bool accelerating) {
  std::vector<NamedFormula> balance;
  const VariableLayout& layout = equations.layout();
  const auto add = [&](Node equation, const std::string& name) {
    if (!equations.graph().isConstant(equation, 0.0)) balance.push_back({equation, name});
  };
  expression::Graph& graph = equations.graph();
  const bool is_gauss = scene.principle == Principle::kGauss;
  for (int i = 0; i < layout.S; ++i) {
    const std::string shaft = "shaft " + inQuotes(scene.shafts[at(i)]);
    add(graph.subtract(equations.reaction(i), equations.combine(i, layout.multiplier(0))),
        "the torques on " + shaft);
    Node rate =
        graph.subtract(equations.reactionRate(i), equations.combine(i, layout.multiplierRate(0)));
    for (int m = 0; m < layout.k && is_gauss; ++m) {
      const Node turn = equations.constraints()[at(m)].C_rate[at(i)];
      rate = graph.subtract(rate, graph.multiply(equations.variable(layout.multiplier(m)), turn));
    }
    if (!is_gauss && !equations.hasConstantInertia()) {
      rate = graph.subtract(rate, equations.connection(i));
      add(graph.subtract(equations.auxiliaryTorque(i), equations.reaction(i)), "");
    }
    add(rate, "the rates of the torques on " + shaft);
    if (!accelerating) continue;
    add(graph.subtract(equations.variable(layout.jerk(i)),
                       graph.multiply(equations.variable(layout.growth()),
                                      equations.variable(layout.acceleration(i)))),
        "the ratio of accelerations of " + shaft);
  }
  for (int m = 0; m < layout.k; ++m) {
    const ConstraintFormulas& it = equations.constraints()[at(m)];
    const std::string name = "constraint " + inQuotes(scene.constraints[at(m)]->name());
    if (it.velocity != Node{}) add(it.velocity, name);
    if (it.acceleration != Node{}) add(it.acceleration, name);
    add(it.jerk, "the rate of " + name);
  }
  return balance;
}

}  // namespace variator_sim
