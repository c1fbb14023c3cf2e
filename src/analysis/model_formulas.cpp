#include "analysis/model_formulas.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

using expression::Node;

namespace {

/// Adds E and its unknowns y.
void addEquations(MotionEquations& equations, MotionKind kind, ModelFormulas& formulas) {
  expression::Graph& graph = equations.graph();
  const VariableLayout& layout = equations.layout();
  const auto add = [&](Node equation, int unknown) {
    formulas.all.push_back(equation);
    formulas.unknowns.push_back(unknown);
  };
  const bool is_classical = kind == MotionKind::kClassical;
  const bool is_formal = kind == MotionKind::kFormal;
  for (int i = 0; i < layout.S; ++i) {
    add(is_classical ? equations.balance(i) : equations.balanceOfRates(i),
        is_classical ? layout.acceleration(i) : layout.jerk(i));
  }
  for (int m = 0; m < layout.k; ++m) {
    const ConstraintFormulas& constraint = equations.constraints()[at(m)];
    add(is_classical ? constraint.acceleration : constraint.jerk,
        is_classical ? layout.multiplier(m) : layout.multiplierRate(m));
  }
  if (!is_formal && (is_classical || equations.hasConstantInertia())) return;
  for (int i = 0; i < layout.S; ++i) {
    const Node torque = is_formal ? equations.balance(i) : equations.reaction(i);
    add(graph.subtract(equations.auxiliaryTorque(i), torque), layout.auxiliary(i));
  }
  for (int m = 0; m < layout.k && is_formal; ++m) {
    const auto of_shaft = [&](int i) {
      return graph.multiply(equations.constraints()[at(m)].C[at(i)],
                            equations.variable(layout.auxiliary(i)));
    };
    add(equations.sum(layout.S, of_shaft), layout.multiplier(m));
  }
}

void addRows(const MotionEquations& equations, MotionKind kind, ModelFormulas& formulas) {
  const auto add = [&](Node ConstraintFormulas::*level) {
    int count = 0;
    for (const ConstraintFormulas& constraint : equations.constraints()) {
      if (constraint.*level == Node{}) continue;
      formulas.all.push_back(constraint.*level);
      ++count;
    }
    return count;
  };
  formulas.velocity_rows = add(&ConstraintFormulas::velocity);
  if (kind == MotionKind::kClassical) return;
  formulas.acceleration_rows = add(&ConstraintFormulas::acceleration);
}

void addConserved(MotionEquations& equations, ModelFormulas& formulas) {
  // R' = D^T Lambda: h.R is conserved for every h with D h = 0 at all states. With an inertia that
  // depends on the angle it is R_i / sqrt(J_i) of a shaft that no constraint reads.
  expression::Graph& graph = equations.graph();
  const auto& constraints = equations.constraints();
  const bool is_constant =
      equations.hasConstantInertia() &&
      std::all_of(constraints.begin(), constraints.end(),
                  [](const ConstraintFormulas& constraint) { return constraint.has_constant_C; });
  if (!equations.hasConstantInertia() && !equations.hasDiagonalInertia()) return;
  for (int i = 0; i < equations.layout().S; ++i) {
    const bool is_neutral = std::all_of(
        constraints.begin(), constraints.end(),
        [&](const ConstraintFormulas& it) { return graph.isConstant(it.D[at(i)], 0.0); });
    if (!is_neutral && !is_constant) continue;
    const Node root = graph.make(expression::Operation::kSqrt, equations.inertia(i, i));
    const Node row = equations.reaction(i);
    // (For a constant D all R_i are stated; calcManifoldRows combines them.)
    formulas.all.push_back(equations.hasConstantInertia() ? row : graph.divide(row, root));
    ++formulas.conserved_rows;
  }
}

/// Rejects formulas with the multiplier of a stuck element, of which generalized_gauss knows the
/// rate alone.
void refuseHeldTorques(MotionEquations& equations, const Scene& scene, Node node,
                       const std::string& name) {
  if (kindOf(scene) != MotionKind::kGeneralized) return;
  const VariableLayout& layout = equations.layout();
  for (int m = 0; m < layout.k; ++m) {
    if (!equations.graph().dependsOn(node, layout.slot(layout.multiplier(m)))) continue;
    throw SceneError(name, "reads the torque of " + equations.constraints()[at(m)].name +
                               ", which a linear model under 'principle: generalized_gauss' does "
                               "not have; allowed: 'principle: gauss', or another formula");
  }
}

void addOutputs(MotionEquations& equations, const Scene& scene, ModelFormulas& formulas) {
  const VariableLayout& layout = equations.layout();
  std::vector<Node>& all = formulas.all;
  formulas.outputs = shaftQuantities(scene);
  for (int i = 0; i < layout.S; ++i) {
    for (const int variable : {layout.angle(i), layout.velocity(i), layout.acceleration(i)}) {
      all.push_back(equations.variable(variable));
    }
    all.push_back(equations.torque(i));
    all.push_back(equations.reaction(i));
  }
  for (const Output& output : scene.outputs) {
    if (output.reads_principle) continue;
    all.push_back(equations.inModes(output.node));
    refuseHeldTorques(equations, scene, all.back(), output.name);
    formulas.outputs.push_back("outputs/" + output.name);
  }
}

}  // namespace

MotionKind kindOf(const Scene& scene) {
  if (scene.principle == Principle::kGeneralizedGauss) return MotionKind::kGeneralized;
  return scene.hasOrder3() ? MotionKind::kFormal : MotionKind::kClassical;
}

ModelFormulas makeModelFormulas(MotionEquations& equations, const Scene& scene) {
  const MotionKind kind = kindOf(scene);
  ModelFormulas formulas;
  addEquations(equations, kind, formulas);
  // z' = rate of the scene's own states
  for (const SceneState& state : scene.states) {
    const int z_rate = equations.layout().inputRate(state.input);
    const Node rate = equations.inModes(state.rate);
    refuseHeldTorques(equations, scene, rate, scene.inputs[at(state.input)].name);
    formulas.all.push_back(equations.graph().subtract(equations.variable(z_rate), rate));
    formulas.unknowns.push_back(z_rate);
  }
  addRows(equations, kind, formulas);
  if (kind == MotionKind::kGeneralized) addConserved(equations, formulas);
  addOutputs(equations, scene, formulas);
  return formulas;
}

std::vector<std::string> shaftQuantities(const Scene& scene) {
  std::vector<std::string> names;
  for (const std::string& shaft : scene.shafts) {
    for (const char* const what :
         {"/angle", "/velocity", "/acceleration", "/applied_torque", "/reaction_torque"}) {
      names.push_back(shaft + what);
    }
  }
  return names;
}

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
    if (output.reads_principle) continue;
    list.push_back({output.name, -1, equations.inModes(output.node)});
  }
  return list;
}

}  // namespace variator_sim
