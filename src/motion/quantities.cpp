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
  const auto add_outputs = [&names = names, &nodes](const Law& element) {
    for (const auto& [name, node] : element.outputs()) {
      names.push_back(element.name() + "/" + name);
      nodes.push_back(node);
    }
  };
  const auto add_holds = [&names = names](const Law& element) {
    for (const Holding& it : element.holdings()) {
      for (const char* of : {"/mode", "/torque", "/slip", "/reserve", "/heat"}) {
        names.push_back(element.nameOf(it) + of);
      }
    }
  };
  for (const TorquePtr& torque : scene_.torques) {
    shafts_.push_back(torque->shafts());
    for (const int i : shafts_.back()) {
      names.push_back(torque->name() + "/" + scene_.shafts[static_cast<std::size_t>(i)] +
                      "/torque");
    }
    names.push_back(torque->name() + "/power");
    add_holds(*torque);
    add_outputs(*torque);
  }
  for (const ConstraintPtr& constraint : scene_.constraints) {
    add_holds(*constraint);
    add_outputs(*constraint);
  }
  element_outputs_ = {*scene.graph, nodes};
}

void Quantities::calc(QuantityGroup group, const StateView& state, const Sample& sample,
                      double* values) const {
  switch (group) {
    case QuantityGroup::kElements:
      calcElements(state, values);
      break;
    case QuantityGroup::kInputs:
      calcInputs(InputKind::kCommanded, state, values);
      break;
    case QuantityGroup::kStates:
      calcInputs(InputKind::kState, state, values);
      break;
    case QuantityGroup::kVariables:
      calcInputs(InputKind::kVariable, state, values);
      break;
    case QuantityGroup::kOutputs:
      calcOutputs(state, sample, values);
      break;
    case QuantityGroup::kPrinciple:
      calcPrinciple(state, sample, values);
      break;
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

void Quantities::calcInputs(InputKind kind, const StateView& state, double* values) const {
  for (std::size_t i = 0; i < scene_.inputs.size(); ++i) {
    if (scene_.inputs[i].kind == kind) *values++ = state.input[i];
  }
}

namespace {

double* writeHolds(const HeldElement* held, std::size_t count, double* values) {
  for (; count > 0; --count, ++held) {
    for (const double it : {1.0 * held->mode, held->torque, held->slip, held->reserve, held->heat})
      *values++ = it;
  }
  return values;
}

}  // namespace

void Quantities::calcElements(const StateView& state, double* values) const {
  const HeldElement* held = state.held;
  const double* outputs = element_outputs_.evaluate(state);
  const auto write_outputs = [&](const Law& element) {
    const std::size_t count = element.outputs().size();
    values = std::copy_n(outputs, count, values);
    outputs += count;
  };
  for (std::size_t j = 0; j < scene_.torques.size(); ++j) {
    double Q[kMaxShafts] = {};
    const std::size_t holds = held != nullptr ? scene_.torques[j]->holdings().size() : 0;
    if (holds == 0) scene_.torques[j]->addTorque(state, Q);
    for (std::size_t n = 0; n < holds; ++n) {
      for (const int i : shafts_[j]) Q[i] += held[n].on_shaft[i];
    }
    double power = 0.0;
    for (const int i : shafts_[j]) {
      *values++ = Q[i];
      power += Q[i] * state.velocity[i];
    }
    *values++ = power;
    values = writeHolds(held, holds, values);
    held += holds;
    write_outputs(*scene_.torques[j]);
  }
  for (const ConstraintPtr& constraint : scene_.constraints) {
    const std::size_t holds = held != nullptr ? constraint->holdings().size() : 0;
    values = writeHolds(held, holds, values);
    held += holds;
    write_outputs(*constraint);
  }
}

}  // namespace variator_sim
