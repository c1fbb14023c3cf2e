#include "motion/quantities.h"

#include <algorithm>

#include "model/formula_laws.h"

namespace variator_sim {

const char* toString(QuantityGroup group) {
  constexpr const char* kNames[] = {"elements",  "inputs",   "outputs", "states",
                                    "variables", "principle"};  // as they are enumerated
  return kNames[static_cast<std::size_t>(group)];
}

Quantities::Quantities(const Scene& scene)
    : scene_(scene),
      has_formulas_(!scene.inertia_harmonics.empty() || !scene.inertia_formulas.empty()) {
  // Numbers of inertias in the graph would be constants of its formulas, too.
  if (has_formulas_) inertia_ = {*scene.graph, inertiaOf(*scene.graph, scene)};
  auto& [names, inputs, outputs, states, variables, principle] = names_;
  for (const CommandInputSettings& input : scene.inputs) {
    if (input.kind == InputKind::kDelayed) continue;
    (input.kind == InputKind::kState      ? states
     : input.kind == InputKind::kVariable ? variables
                                          : inputs)
        .push_back(input.name);
  }
  std::vector<expression::Node> nodes;
  for (const Output& output : scene.outputs) {
    outputs.push_back(output.name);
    nodes.push_back(output.node);
    reads_principle_ = reads_principle_ || output.reads_principle;
  }
  outputs_ = {*scene.graph, nodes};
  nodes.clear();
  for (const std::string& shaft : scene.shafts) {
    principle.push_back(shaft + "/reaction_torque_covariant_rate");
  }
  for (const char* measure : {"principle/Z", "principle/constraint_measure"}) {
    principle.emplace_back(measure);
  }
  for (const Law* const law : scene.laws()) {
    const auto* const torque = dynamic_cast<const Torque*>(law);
    elements_.push_back({law, torque, torque != nullptr ? torque->shafts() : std::vector<int>()});
    for (const int i : elements_.back().shafts) {
      names.push_back(law->name() + "/" + scene.shafts[static_cast<std::size_t>(i)] + "/torque");
    }
    if (torque != nullptr) names.push_back(law->name() + "/power");
    for (const Holding& it : law->holdings()) {
      for (const char* of : {"/mode", "/torque", "/slip", "/reserve", "/heat"}) {
        names.push_back(law->nameOf(it) + of);
      }
    }
    for (const auto& [name, node] : law->outputs()) {
      names.push_back(law->name() + "/" + name);
      nodes.push_back(node);
    }
  }
  element_outputs_ = {*scene.graph, nodes};
}

void Quantities::calc(QuantityGroup group, const StateView& state, const Sample& sample,
                      double* values) const {
  if (group == QuantityGroup::kElements) return calcElements(state, values);
  if (group == QuantityGroup::kOutputs) return calcOutputs(state, sample, values);
  if (group == QuantityGroup::kPrinciple) return calcPrinciple(state, sample, values);
  const InputKind kind = group == QuantityGroup::kInputs   ? InputKind::kCommanded
                         : group == QuantityGroup::kStates ? InputKind::kState
                                                           : InputKind::kVariable;
  for (std::size_t i = 0; i < scene_.inputs.size(); ++i) {
    if (scene_.inputs[i].kind == kind) *values++ = state.input[i];
  }
}

void Quantities::calcOutputs(const StateView& state, const Sample& sample, double* values) const {
  StateView observed = state;
  double input[kFirstObserved + kMaxObserved];
  if (reads_principle_) {
    const std::size_t known = scene_.inputs.size();
    std::copy_n(state.input, state.held != nullptr ? kFirstObserved : known, input);
    calcPrinciple(state, sample, input + kFirstObserved);
    observed.input = input;
  }
  outputs_.evaluate(observed, values);
}

void Quantities::calcPrinciple(const StateView& state, const Sample& sample, double* values) const {
  const int S = scene_.shaftCount();
  const DenseMatrix J = calcInertia(state);
  const auto measure = [&](const double* torque) {
    const Eigen::Map<const Eigen::VectorXd> F(torque, S);
    DenseVector by_inertia = F;
    solveSymmetric(J, 0.0, &by_inertia);
    return 0.5 * F.dot(by_inertia);
  };
  values = std::copy_n(sample.reaction_torque_covariant_rate, S, values);
  *values++ = measure(sample.reaction_torque_covariant_rate);
  *values = measure(sample.reaction_torque);
}

DenseMatrix Quantities::calcInertia(const StateView& state) const {
  const int S = scene_.shaftCount();
  if (has_formulas_) return Eigen::Map<const Eigen::MatrixXd>(inertia_.evaluate(state), S, S);
  return scene_.inertia;
}

bool Quantities::isInertiaLost(const StateView& state) const {
  if (scene_.inertia_formulas.empty()) return false;
  const DenseMatrix J = calcInertia(state);
  constexpr double kLost = 1e-6;  // of the largest entry: accelerations grow as its inverse
  DenseVector unused = DenseVector::Zero(J.rows());
  return !solveSymmetric(J, kLost * J.cwiseAbs().maxCoeff(), &unused);
}

void Quantities::calcElements(const StateView& state, double* values) const {
  const HeldElement* held = state.held;
  const double* outputs = element_outputs_.evaluate(state);
  for (const Element& it : elements_) {
    const std::size_t holds = held != nullptr ? it.law->holdings().size() : 0;
    if (it.torque != nullptr) {
      double Q[kMaxShafts] = {};
      if (holds == 0) it.torque->addTorque(state, Q);
      for (std::size_t n = 0; n < holds; ++n) {
        for (const int i : it.shafts) Q[i] += held[n].on_shaft[i];
      }
      double power = 0.0;
      for (const int i : it.shafts) {
        *values++ = Q[i];
        power += Q[i] * state.velocity[i];
      }
      *values++ = power;
    }
    for (std::size_t n = 0; n < holds; ++n, ++held) {
      values = std::copy_n(
          std::array{1.0 * held->mode, held->torque, held->slip, held->reserve, held->heat}.data(),
          5, values);
    }
    const std::size_t count = it.law->outputs().size();
    values = std::copy_n(outputs, count, values);
    outputs += count;
  }
}

}  // namespace variator_sim
