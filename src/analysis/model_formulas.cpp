#include "analysis/model_formulas.h"

#include <algorithm>
#include <utility>

namespace variator_sim {
namespace {

using expression::Node;

class Maker {
 public:
  Maker(MotionEquations& equations, const Scene& scene)
      : scene_(scene), kind_(kindOf(scene)), equations_(equations), layout_(equations.layout()) {}
  ModelFormulas make() {
    stateMotion();
    if (kind_ == MotionKind::kFormal || hasConnection()) stateAuxiliary();
    stateRows();
    if (kind_ == MotionKind::kGeneralized) stateConserved();
    stateOutputs();
    return std::move(formulas_);
  }

 private:
  bool hasConnection() const {
    return kind_ == MotionKind::kGeneralized && !equations_.hasConstantInertia();
  }
  void stateMotion();
  void stateAuxiliary();
  void stateRows();
  void stateConserved();
  void stateOutputs();

  const Scene& scene_;
  const MotionKind kind_;
  MotionEquations& equations_;
  const VariableLayout& layout_;
  ModelFormulas formulas_;
};

void Maker::stateMotion() {
  expression::Graph& graph = equations_.graph();
  const int S = layout_.S;
  const int k = layout_.k;
  std::vector<Node>& E = formulas_.all;
  std::vector<int>& y = formulas_.unknowns;
  for (int i = 0; i < S; ++i) {
    if (kind_ == MotionKind::kClassical) {
      const Node C_lambda = equations_.combine(i, layout_.multiplier(0));
      E.push_back(graph.subtract(equations_.reaction(i), C_lambda));
      y.push_back(layout_.acceleration(i));
      continue;
    }
    Node rest = graph.subtract(equations_.reactionRate(i),
                               equations_.combine(i, layout_.multiplierRate(0)));
    if (hasConnection()) rest = graph.subtract(rest, equations_.connection(i));
    for (int m = 0; m < k && kind_ == MotionKind::kFormal; ++m) {
      const Node turn = equations_.constraints()[at(m)].C_rate[at(i)];
      rest = graph.subtract(rest, graph.multiply(equations_.variable(layout_.multiplier(m)), turn));
    }
    E.push_back(rest);
    y.push_back(layout_.jerk(i));
  }
  for (int m = 0; m < k; ++m) {
    const ConstraintFormulas& constraint = equations_.constraints()[at(m)];
    const bool is_classical = kind_ == MotionKind::kClassical;
    E.push_back(is_classical ? constraint.acceleration : constraint.jerk);
    y.push_back(is_classical ? layout_.multiplier(m) : layout_.multiplierRate(m));
  }
}

void Maker::stateAuxiliary() {
  expression::Graph& graph = equations_.graph();
  const int S = layout_.S;
  std::vector<Node>& E = formulas_.all;
  std::vector<int>& y = formulas_.unknowns;
  for (int i = 0; i < S; ++i) {
    Node rest = graph.subtract(equations_.auxiliaryTorque(i), equations_.reaction(i));
    if (kind_ == MotionKind::kFormal) {
      rest = graph.add(rest, equations_.combine(i, layout_.multiplier(0)));
    }
    E.push_back(rest);
    y.push_back(layout_.auxiliary(i));
  }
  for (int m = 0; m < layout_.k && kind_ == MotionKind::kFormal; ++m) {
    Node sum = graph.constant(0.0);
    for (int i = 0; i < S; ++i) {
      sum = graph.add(sum, graph.multiply(equations_.constraints()[at(m)].C[at(i)],
                                          equations_.variable(layout_.auxiliary(i))));
    }
    E.push_back(sum);
    y.push_back(layout_.multiplier(m));
  }
}

void Maker::stateRows() {
  for (const ConstraintFormulas& constraint : equations_.constraints()) {
    if (constraint.velocity == Node{}) continue;
    formulas_.all.push_back(constraint.velocity);
    ++formulas_.velocity_rows;
  }
  if (kind_ == MotionKind::kClassical) return;
  for (const ConstraintFormulas& constraint : equations_.constraints()) {
    if (constraint.acceleration == Node{}) continue;
    formulas_.all.push_back(constraint.acceleration);
    ++formulas_.acceleration_rows;
  }
}

void Maker::stateConserved() {
  // R' = C^T Lambda: h.R stays as it is for every h with C h = 0 at all states. With an inertia
  // that depends on the angle it is R_i / sqrt(J_i) of a shaft that no constraint reads.
  expression::Graph& graph = equations_.graph();
  const auto& constraints = equations_.constraints();
  const bool is_constant =
      equations_.hasConstantInertia() &&
      std::all_of(constraints.begin(), constraints.end(),
                  [](const ConstraintFormulas& constraint) { return constraint.has_constant_C; });
  if (!equations_.hasConstantInertia() && !equations_.hasDiagonalInertia()) return;
  for (int i = 0; i < layout_.S; ++i) {
    const bool is_neutral = std::all_of(
        constraints.begin(), constraints.end(),
        [&](const ConstraintFormulas& it) { return graph.isConstant(it.C[at(i)], 0.0); });
    if (!is_neutral && !is_constant) continue;
    const Node root = graph.make(expression::Operation::kSqrt, equations_.inertia(i, i));
    const Node row = equations_.reaction(i);
    // (Of a constant C all R_i are stated; findConserved combines them.)
    formulas_.all.push_back(equations_.hasConstantInertia() ? row : graph.divide(row, root));
    ++formulas_.conserved_rows;
  }
}

void Maker::stateOutputs() {
  std::vector<Node>& all = formulas_.all;
  const std::size_t before = all.size();
  for (int i = 0; i < layout_.S; ++i) {
    for (const int variable : {layout_.angle(i), layout_.velocity(i), layout_.acceleration(i)}) {
      all.push_back(equations_.variable(variable));
    }
    all.push_back(equations_.torque(i));
    all.push_back(equations_.reaction(i));
  }
  for (const Output& output : scene_.outputs) all.push_back(output.node());
  formulas_.outputs = static_cast<int>(all.size() - before);
}

}  // namespace

MotionKind kindOf(const Scene& scene) {
  if (scene.principle == Principle::kGeneralizedGauss) return MotionKind::kGeneralized;
  return scene.hasOrder3() ? MotionKind::kFormal : MotionKind::kClassical;
}

ModelFormulas makeModelFormulas(MotionEquations& equations, const Scene& scene) {
  return Maker(equations, scene).make();
}

std::vector<std::string> outputNames(const Scene& scene) {
  std::vector<std::string> names;
  for (const std::string& shaft : scene.shafts) {
    for (const char* const what :
         {"/angle", "/velocity", "/acceleration", "/applied_torque", "/reaction_torque"}) {
      names.push_back(shaft + what);
    }
  }
  for (const Output& output : scene.outputs) names.push_back("outputs/" + output.name());
  return names;
}

}  // namespace variator_sim
