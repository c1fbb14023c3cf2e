#include "analysis/motion_equations.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "model/interrupted.h"
#include "variator_sim/expression/state_derivatives.h"
#include "variator_sim/formula_constraint.h"
#include "variator_sim/formula_torque.h"

namespace variator_sim {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using expression::Graph;
using expression::Node;
using expression::slotOf;
using expression::Source;

int VariableLayout::slot(int n) const {
  if (n == 0) return slotOf(Source::kTime);
  if (n < velocity(0)) return slotOf(Source::kAngle, n - angle(0));
  if (n < acceleration(0)) return slotOf(Source::kVelocity, n - velocity(0));
  if (n < input(0)) return slotOf(Source::kAcceleration, n - acceleration(0));
  if (n < inputRate(0)) return slotOf(Source::kInput, n - input(0));
  if (n < inputSecondRate(0)) return slotOf(Source::kInputRate, n - inputRate(0));
  return slotOf(Source::kInputSecondRate, n - inputSecondRate(0));
}

StateView VariableLayout::view(const VectorXd& v) const {
  const double* const data = v.data();
  return {data[0],         data + angle(0),     data + velocity(0),       data + acceleration(0),
          data + input(0), data + inputRate(0), data + inputSecondRate(0)};
}

MotionEquations::MotionEquations(const Scene& scene, bool numeric, bool with_rates_of_c)
    : scene_(scene), graph_(*scene.graph), with_rates_of_c_(with_rates_of_c) {
  layout_.S = scene.shaftCount();
  layout_.k = scene.constraintCount();
  layout_.U = scene.inputCount();
  layout_.opaque = countOpaque(numeric);
  std::set<int> inputs;
  for (int i = 0; i < layout_.U; ++i) inputs.insert(i);
  rates_ = expression::ratesOf(graph_, layout_.S, inputs);
  for (int i = 0; i < layout_.S; ++i) {
    rates_.emplace_back(layout_.slot(layout_.acceleration(i)), variable(layout_.jerk(i)));
  }
  addTorques(numeric);
  for (const ConstraintPtr& constraint : scene.constraints) addConstraint(*constraint, numeric);
}

bool MotionEquations::isFormula(const Torque& torque) const {
  const auto* law = dynamic_cast<const FormulaTorque*>(&torque);
  if (law == nullptr || &law->graph() != scene_.graph.get()) return false;
  std::vector<Node> nodes;
  for (const auto& [shaft, node] : law->torques()) nodes.push_back(node);
  return !graph_.hasOpaque(nodes);
}

bool MotionEquations::isFormula(const Constraint& constraint) const {
  const auto* law = dynamic_cast<const FormulaConstraint*>(&constraint);
  return law != nullptr && &law->graph() == scene_.graph.get() &&
         !graph_.hasOpaque({law->function()});
}

/// C, c0, f, f' or psi, and what makes dC/dt: D and H.
int MotionEquations::opaqueSize(const Constraint& /*constraint*/) const {
  const int S = layout_.S;
  return S + 3 + (with_rates_of_c_ ? S + S * S : 0);
}

int MotionEquations::countOpaque(bool numeric) {
  int count = 0;
  for (const TorquePtr& torque : scene_.torques) {
    if (!numeric && isFormula(*torque)) continue;
    opaque_torques_.push_back(torque.get());
  }
  // Q and Q' of all of them together
  if (!opaque_torques_.empty()) count += 2 * layout_.S;
  for (const ConstraintPtr& constraint : scene_.constraints) {
    if (!numeric && isFormula(*constraint)) continue;
    opaque_constraints_.push_back(constraint.get());
    count += opaqueSize(*constraint);
  }
  return count;
}

void MotionEquations::addTorques(bool numeric) {
  const auto s = static_cast<std::size_t>(layout_.S);
  torques_.assign(s, graph_.constant(0.0));
  opaque_torque_rates_.assign(s, graph_.constant(0.0));
  for (const TorquePtr& torque : scene_.torques) {
    if (numeric || !isFormula(*torque)) continue;
    for (const auto& [shaft, node] : static_cast<const FormulaTorque&>(*torque).torques()) {
      Node& sum = torques_[static_cast<std::size_t>(shaft)];
      sum = graph_.add(sum, node);
    }
  }
  for (int i = 0; i < layout_.S && !opaque_torques_.empty(); ++i) {
    Node& sum = torques_[static_cast<std::size_t>(i)];
    sum = graph_.add(sum, variable(layout_.opaqueValue(i)));
    opaque_torque_rates_[static_cast<std::size_t>(i)] =
        variable(layout_.opaqueValue(layout_.S + i));
  }
}

void MotionEquations::addConstraint(const Constraint& constraint, bool numeric) {
  if (numeric || !isFormula(constraint)) {
    int first = opaque_torques_.empty() ? 0 : 2 * layout_.S;
    for (const Constraint* const other : opaque_constraints_) {
      if (other == &constraint) break;
      first += opaqueSize(*other);
    }
    addOpaqueConstraint(constraint, layout_.opaqueValue(first));
    return;
  }
  const auto& law = static_cast<const FormulaConstraint&>(constraint);
  ConstraintFormulas formulas;
  formulas.C.assign(law.row().begin(), law.row().end() - 1);
  formulas.has_constant_C = constraint.hasConstantJacobian();
  if (constraint.order() == 3) {
    formulas.jerk = law.row().back();
    for (int i = 0; i < layout_.S; ++i) {
      const Node C = formulas.C[static_cast<std::size_t>(i)];
      formulas.jerk = graph_.add(formulas.jerk, graph_.multiply(C, variable(layout_.jerk(i))));
    }
  } else {
    if (constraint.order() == 1) formulas.velocity = law.function();
    formulas.acceleration = constraint.order() == 1 ? rate(law.function()) : law.function();
    formulas.jerk = rate(formulas.acceleration);
  }
  for (const Node C : formulas.C) {
    if (with_rates_of_c_) formulas.C_rate.push_back(rate(C));
  }
  constraints_.push_back(std::move(formulas));
}

void MotionEquations::addOpaqueConstraint(const Constraint& constraint, int first) {
  const int S = layout_.S;
  ConstraintFormulas formulas;
  formulas.has_constant_C = constraint.hasConstantJacobian();
  formulas.jerk = variable(first + S);
  for (int i = 0; i < S; ++i) {
    formulas.C.push_back(variable(first + i));
    formulas.jerk =
        graph_.add(formulas.jerk, graph_.multiply(formulas.C.back(), variable(layout_.jerk(i))));
  }
  if (constraint.order() == 1) formulas.velocity = variable(first + S + 1);
  if (constraint.order() < 3) formulas.acceleration = variable(first + S + 2);
  for (int i = 0; i < S && with_rates_of_c_; ++i) {
    Node sum = variable(first + S + 3 + i);
    for (int j = 0; j < S; ++j) {
      const Node H = variable(first + S + 3 + S + i * S + j);
      sum = graph_.add(sum, graph_.multiply(H, variable(layout_.jerk(j))));
    }
    formulas.C_rate.push_back(sum);
  }
  constraints_.push_back(std::move(formulas));
}

bool MotionEquations::hasDiagonalInertia() const {
  return scene_.inertia.isDiagonal(0.0);
}

Node MotionEquations::inertia(int i, int j) {
  Node entry = graph_.constant(scene_.inertia(i, j));
  if (i != j || scene_.inertia_harmonics.empty()) return entry;
  for (const InertiaHarmonic& harmonic : scene_.inertia_harmonics[static_cast<std::size_t>(i)]) {
    const Node phase = graph_.multiply(graph_.constant(harmonic.order), variable(layout_.angle(i)));
    entry = graph_.add(entry, graph_.multiply(graph_.constant(harmonic.cosine),
                                              graph_.make(expression::Operation::kCos, phase)));
    entry = graph_.add(entry, graph_.multiply(graph_.constant(harmonic.sine),
                                              graph_.make(expression::Operation::kSin, phase)));
  }
  return entry;
}

Node MotionEquations::reaction(int i) {
  Node sum = graph_.negate(torque(i));
  for (int j = 0; j < layout_.S; ++j) {
    sum = graph_.add(sum, graph_.multiply(inertia(i, j), variable(layout_.acceleration(j))));
  }
  // n = 1/2 J' omega^2
  const Node slope = graph_.differentiate(inertia(i, i), layout_.slot(layout_.angle(i)));
  const Node omega = variable(layout_.velocity(i));
  const Node square = graph_.multiply(omega, omega);
  return graph_.add(sum, graph_.multiply(graph_.multiply(graph_.constant(0.5), slope), square));
}

Node MotionEquations::reactionRate(int i) {
  return graph_.subtract(rate(reaction(i)), opaque_torque_rates_[static_cast<std::size_t>(i)]);
}

Node MotionEquations::connection(int i) {
  const Node slope = graph_.differentiate(inertia(i, i), layout_.slot(layout_.angle(i)));
  const Node half = graph_.multiply(graph_.constant(0.5), slope);
  return graph_.multiply(graph_.multiply(half, variable(layout_.velocity(i))),
                         variable(layout_.auxiliary(i)));
}

Node MotionEquations::balance(int i) {
  return graph_.subtract(reaction(i), combine(i, layout_.multiplier(0)));
}

Node MotionEquations::balanceOfRates(int i) {
  Node rest = graph_.subtract(reactionRate(i), combine(i, layout_.multiplierRate(0)));
  if (!with_rates_of_c_) {
    return hasConstantInertia() ? rest : graph_.subtract(rest, connection(i));
  }
  for (int m = 0; m < layout_.k; ++m) {
    const Node turn = constraints_[static_cast<std::size_t>(m)].C_rate[static_cast<std::size_t>(i)];
    rest = graph_.subtract(rest, graph_.multiply(variable(layout_.multiplier(m)), turn));
  }
  return rest;
}

Node MotionEquations::auxiliaryTorque(int i) {
  Node sum = graph_.constant(0.0);
  for (int j = 0; j < layout_.S; ++j) {
    sum = graph_.add(sum, graph_.multiply(inertia(i, j), variable(layout_.auxiliary(j))));
  }
  return sum;
}

Node MotionEquations::combine(int i, int first) {
  Node sum = graph_.constant(0.0);
  for (int m = 0; m < layout_.k; ++m) {
    const Node C = constraints_[static_cast<std::size_t>(m)].C[static_cast<std::size_t>(i)];
    sum = graph_.add(sum, graph_.multiply(C, variable(first + m)));
  }
  return sum;
}

void MotionEquations::fillOpaque(VectorXd& v) const {
  const int S = layout_.S;
  const StateView state = layout_.view(v);
  double* values = v.data() + layout_.opaqueValue(0);
  // The laws do not read what is written here.
  if (!opaque_torques_.empty()) {
    std::fill_n(values, 2 * S, 0.0);
    for (const Torque* const torque : opaque_torques_) {
      torque->addTorque(state, values);
      torque->addTorqueRate(state, values + S);
    }
    values += 2 * S;
  }
  for (const Constraint* const constraint : opaque_constraints_) {
    constraint->calcRow(state, values, values + S);
    double unused[kMaxShafts];
    values[S + 1] = constraint->order() == 1 ? constraint->calcResidual(state) : 0.0;
    values[S + 2] =
        constraint->order() < 3 ? constraint->calcResidualAndJacobian(state, unused) : 0.0;
    if (with_rates_of_c_) {
      constraint->calcJacobianRate(state, values + S + 3, values + S + 3 + S);
    }
    values += opaqueSize(*constraint);
  }
}

MatrixXd MotionEquations::calcOpaqueDerivatives(const VectorXd& v) const {
  // Central differences of order 4.
  constexpr double kStep = 1e-3;
  MatrixXd derivatives = MatrixXd::Zero(layout_.opaque, layout_.size());
  VectorXd shifted = v;
  const auto values = [&](int n, double shift) -> VectorXd {
    shifted = v;
    shifted(n) += shift;
    fillOpaque(shifted);
    return shifted.segment(layout_.opaqueValue(0), layout_.opaque);
  };
  for (int n = 0; n < layout_.size(); ++n) {
    const bool is_read = n < layout_.jerk(0) || n >= layout_.inputRate(0) ||
                         (n >= layout_.input(0) && n < layout_.multiplier(0));
    if (!is_read) continue;
    const double h = kStep * std::max(1.0, std::abs(v(n)));
    derivatives.col(n) =
        (8.0 * (values(n, h) - values(n, -h)) - (values(n, 2.0 * h) - values(n, -2.0 * h))) /
        (12.0 * h);
  }
  return derivatives;
}

DifferentiatedFormulas::DifferentiatedFormulas(MotionEquations& equations,
                                               const std::vector<Node>& formulas)
    : equations_(equations), count_(static_cast<int>(formulas.size())) {
  Graph& graph = equations.graph();
  const int most = graph.size() + expression::StateDerivatives::kMostNodes;
  std::vector<Node> outputs = formulas;
  for (int n = 0; n < equations.layout().size(); ++n) {
    for (int f = 0; f < count_; ++f) {
      const Node derivative =
          graph.differentiate(formulas[static_cast<std::size_t>(f)], equations.layout().slot(n));
      if (graph.size() > most) throw std::length_error("derivatives");
      if (graph.isConstant(derivative, 0.0)) continue;
      outputs.push_back(derivative);
      entries_.emplace_back(f, n);
    }
  }
  tape_ = expression::Tape(graph, outputs);
}

void DifferentiatedFormulas::evaluate(VectorXd& v, VectorXd& values, MatrixXd& derivatives) const {
  endIfInterrupted();
  const VariableLayout& layout = equations_.layout();
  if (layout.opaque > 0) equations_.fillOpaque(v);
  const double* const computed = tape_.evaluate(layout.view(v));
  values = Eigen::Map<const VectorXd>(computed, count_);
  derivatives = MatrixXd::Zero(count_, layout.size());
  for (std::size_t n = 0; n < entries_.size(); ++n) {
    derivatives(entries_[n].first, entries_[n].second) = computed[count_ + static_cast<int>(n)];
  }
  if (layout.opaque == 0) return;
  const MatrixXd by_opaque = derivatives.middleCols(layout.opaqueValue(0), layout.opaque);
  derivatives.middleCols(layout.opaqueValue(0), layout.opaque).setZero();
  derivatives += by_opaque * equations_.calcOpaqueDerivatives(v);
}

}  // namespace variator_sim
