#include "analysis/trim_equations.h"

#include <algorithm>
#include <cmath>

#include "variator_sim/expression/tape.h"

namespace variator_sim {

using expression::Node;

double halton(int n, int dimension) {
  constexpr int kPrimes[] = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37};
  const int base = kPrimes[dimension % 12];
  double value = 0.0;
  double part = 1.0;
  for (int rest = n + 7 * (dimension / 12); rest > 0; rest /= base) {
    part /= base;
    value += part * (rest % base);
  }
  return value;
}

std::string findInputBeyond(const Scene& scene, const double* values) {
  for (int i = 0; i < scene.inputCount(); ++i) {
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    const double value = values[i];
    const double slack = 1e-9 * std::max(1.0, std::abs(value));
    if (value >= input.minimum - slack && value <= input.maximum + slack) continue;
    return inQuotes(input.name) + " would have to be " + formatNumber(value) + ", allowed is " +
           Range::between(input.minimum, input.maximum).toText();
  }
  return "";
}

std::vector<NamedFormula> makeBalance(MotionEquations& equations, const Scene& scene,
                                      bool accelerating) {
  std::vector<NamedFormula> balance;
  const VariableLayout& layout = equations.layout();
  const auto add = [&](Node equation, const std::string& name) {
    if (!equations.graph().isConstant(equation, 0.0)) balance.push_back({equation, name});
  };
  expression::Graph& graph = equations.graph();
  for (int i = 0; i < layout.S; ++i) {
    const std::string shaft = "shaft " + inQuotes(scene.shafts[at(i)]);
    add(equations.balance(i), "the torques on " + shaft);
    if (scene.principle != Principle::kGauss && !equations.hasConstantInertia()) {
      add(graph.subtract(equations.auxiliaryTorque(i), equations.reaction(i)), "");
    }
    add(equations.balanceOfRates(i), "the rates of the torques on " + shaft);
    if (!accelerating) continue;
    add(graph.subtract(equations.variable(layout.jerk(i)),
                       graph.multiply(equations.variable(layout.growth()),
                                      equations.variable(layout.acceleration(i)))),
        "the ratio of accelerations of " + shaft);
  }
  for (int m = 0; m < layout.k; ++m) {
    const ConstraintFormulas& it = equations.constraints()[at(m)];
    const std::string& name = it.name;
    if (it.velocity != Node{}) add(it.velocity, name);
    if (it.acceleration != Node{}) add(it.acceleration, name);
    add(it.jerk, "the rate of " + name);
  }
  for (const SceneState& state : scene.states) {
    const std::string& name = scene.inputs[at(state.input)].name;
    if (state.trims_to_rest) {
      add(equations.inModes(state.rate), "the rate of the state " + inQuotes(name));
    }
  }
  return balance;
}

std::vector<TrimQuantity> listTrimQuantities(MotionEquations& equations, const Scene& scene) {
  const VariableLayout& layout = equations.layout();
  std::vector<TrimQuantity> list;
  for (int i = 0; i < layout.S; ++i) {
    const std::string& shaft = scene.shafts[at(i)];
    list.push_back({"phi_" + shaft, layout.angle(i), {}});
    list.push_back({"w_" + shaft, layout.velocity(i), {}});
    list.push_back({"e_" + shaft, layout.acceleration(i), {}});
  }
  for (int i = 0; i < layout.U; ++i) {
    list.push_back({scene.inputs[at(i)].name, layout.input(i), {}});
  }
  list.push_back({"t", layout.time(), {}});
  for (int i = 0; i < layout.S; ++i) {
    const std::string& shaft = scene.shafts[at(i)];
    list.push_back({shaft + "/angle", layout.angle(i), {}});
    list.push_back({shaft + "/velocity", layout.velocity(i), {}});
    list.push_back({shaft + "/acceleration", layout.acceleration(i), {}});
  }
  for (int i = 0; i < layout.S; ++i) {
    list.push_back({scene.shafts[at(i)] + "/applied_torque", -1, equations.torque(i)});
    list.push_back({scene.shafts[at(i)] + "/reaction_torque", -1, equations.reaction(i)});
  }
  for (const Output& output : scene.outputs) {
    if (output.readsPrinciple()) continue;
    list.push_back({output.name(), -1, equations.inModes(output.node())});
  }
  return list;
}

}  // namespace variator_sim
