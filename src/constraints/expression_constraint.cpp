#include "variator_sim/constraints/expression_constraint.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "variator_sim/expression/parser.h"

namespace variator_sim {

using expression::Graph;
using expression::Node;
using expression::slotOf;
using expression::Source;
using expression::Tape;

void ExpressionConstraint::doConfigure(ComponentContext& context) {
  ParameterReader& reader = context.parameters();
  const int order = reader.integer("order", 1, 3);
  if (order != 2) {
    throw SceneError(reader.keyPath("order"),
                     "this version supports constraints of order 2, not " + std::to_string(order));
  }
  Graph graph;
  const Node psi = readFormula(context, "expression", expression::FormulaKind::kConstraint, graph);
  const std::string path = reader.keyPath("expression");
  const int s = context.shaftCount();
  const auto size = static_cast<std::size_t>(s);

  // c0 = dpsi/dt + dpsi/dphi omega + dpsi/domega epsilon [12]: the total derivative with phi' =
  // omega, omega' = epsilon, and epsilon held (its rate is multiplied by C).
  std::vector<Graph::Rate> rates = {{slotOf(Source::kTime), graph.constant(1.0)}};
  std::vector<int> slots = {slotOf(Source::kTime)};
  for (int i = 0; i < s; ++i) {
    rates.emplace_back(slotOf(Source::kAngle, i), graph.variable(slotOf(Source::kVelocity, i)));
    rates.emplace_back(slotOf(Source::kVelocity, i),
                       graph.variable(slotOf(Source::kAcceleration, i)));
    slots.insert(slots.end(), {slotOf(Source::kAngle, i), slotOf(Source::kVelocity, i),
                               slotOf(Source::kAcceleration, i)});
  }
  std::vector<Node> C;
  C.reserve(size);
  for (int i = 0; i < s; ++i) {
    C.push_back(graph.differentiate(psi, slotOf(Source::kAcceleration, i)));
  }
  const auto is_zero = [&graph](Node node) { return graph.isConstant(node, 0.0); };
  if (std::all_of(C.begin(), C.end(), is_zero)) {
    throw SceneError(path, "the constraint is not of order 2: '" + reader.formula("expression") +
                               "' does not depend on an acceleration (e1.. of the shafts)");
  }
  const Node c0 = graph.totalDerivative(psi, rates);
  std::vector<Node> partials;
  for (const int slot : slots) {
    const Node partial = graph.differentiate(psi, slot);
    if (!is_zero(partial)) {
      partials.push_back(partial);
      partial_slots_.push_back(slot);
    }
  }
  std::vector<Node> hessian(size * size);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = i; j < size; ++j) {
      const Node second =
          graph.differentiate(C[i], slotOf(Source::kAcceleration, static_cast<int>(j)));
      hessian[i * size + j] = second;
      hessian[j * size + i] = second;
    }
  }
  is_linear_ = std::all_of(hessian.begin(), hessian.end(), is_zero);

  std::vector<Node> checked = partials;
  checked.push_back(c0);
  checked.insert(checked.end(), hessian.begin(), hessian.end());
  for (const Node node : checked) {
    if (graph.hasNonFiniteConstant(node)) {
      throw SceneError(path, "a derivative of '" + reader.formula("expression") +
                                 "' has a constant part that is not finite");
    }
  }

  std::vector<Node> residual_and_jacobian = {psi};
  residual_and_jacobian.insert(residual_and_jacobian.end(), C.begin(), C.end());
  std::vector<Node> row = C;
  row.push_back(c0);
  try {
    residual_ = Tape(graph, {psi});
    residual_and_jacobian_ = Tape(graph, residual_and_jacobian);
    row_ = Tape(graph, row);
    partials_ = Tape(graph, partials);
    hessian_ = Tape(graph, hessian);
  } catch (const std::length_error& error) {
    throw SceneError(path, error.what());
  }
}

double ExpressionConstraint::doCalcResidual(const StateView& state) const {
  double psi = 0.0;
  residual_.evaluate(state, &psi);
  return psi;
}

double ExpressionConstraint::doCalcResidualAndJacobian(const StateView& state, double* C) const {
  double values[1 + kMaxShafts];
  residual_and_jacobian_.evaluate(state, values);
  std::copy(values + 1, values + 1 + shaftCount(), C);
  return values[0];
}

void ExpressionConstraint::doCalcRow(const StateView& state, double* C, double* c0) const {
  double values[kMaxShafts + 1];
  row_.evaluate(state, values);
  std::copy(values, values + shaftCount(), C);
  *c0 = values[shaftCount()];
}

void ExpressionConstraint::doCalcPartials(const StateView& state,
                                          ConstraintPartials& partials) const {
  double values[1 + 3 * kMaxShafts];
  partials_.evaluate(state, values);
  for (std::size_t i = 0; i < partial_slots_.size(); ++i) {
    const int index = expression::indexOf(partial_slots_[i]);
    switch (expression::sourceOf(partial_slots_[i])) {
      case Source::kTime:
        partials.time = values[i];
        break;
      case Source::kAngle:
        partials.angle[index] = values[i];
        break;
      case Source::kVelocity:
        partials.velocity[index] = values[i];
        break;
      default:
        partials.acceleration[index] = values[i];
        break;
    }
  }
}

void ExpressionConstraint::doCalcHessian(const StateView& state, double* H) const {
  hessian_.evaluate(state, H);
}

}  // namespace variator_sim
