#include "dynamics/acceleration_constraints.h"

#include <algorithm>
#include <limits>

namespace variator_sim {

namespace {

std::vector<const Constraint*> listOfOrders1And2(const Scene& scene) {
  std::vector<const Constraint*> listed;
  for (const ConstraintPtr& it : scene.constraints) {
    if (it->order() < 3) listed.push_back(it.get());
  }
  return listed;
}

std::vector<expression::Node> sizesOfTerms(expression::Graph& graph,
                                           const std::vector<const Constraint*>& rows, int S) {
  using expression::slotOf;
  using expression::Source;
  std::vector<int> slots = {slotOf(Source::kTime)};
  for (int i = 0; i < S; ++i) {
    for (const Source source : {Source::kAngle, Source::kVelocity, Source::kAcceleration}) {
      slots.push_back(slotOf(source, i));
    }
  }
  std::vector<expression::Node> sizes;
  for (const Constraint* const row : rows) {
    expression::Node size = graph.constant(0.0);
    for (const int slot : slots) {
      const expression::Node slope = graph.differentiate(row->function(), slot);
      const expression::Node term = graph.multiply(slope, graph.variable(slot));
      const bool is_none = row->order() != 2 || graph.isConstant(slope, 0.0);
      if (!is_none) size = graph.add(size, graph.make(expression::Operation::kAbs, term));
    }
    sizes.push_back(size);
  }
  return sizes;
}

}  // namespace

AccelerationConstraints::AccelerationConstraints(const Scene& scene)
    : S(scene.shaftCount()),
      scene_(scene),
      inertia_(scene.inertia, scene.inertia_harmonics),
      torque_(S),
      free_(S),
      constraints_(listOfOrders1And2(scene)),
      rows_(S, rowCount()) {
  for (const Constraint* const it : constraints_) {
    nonlinear_ |= it->nonlinearAccelerations();
    for (const ConstraintPtr& kink : it->kinks()) {
      if (kinks_.size() < kMostKinks) kinks_.push_back(kink.get());
    }
  }
  terms_ = {*scene.graph, sizesOfTerms(*scene.graph, constraints_, S)};
}

void AccelerationConstraints::enter(const StateView& state) {
  inertia_.update(state.angle);
  torque_.setZero();
  for (const TorquePtr& it : scene_.torques) it->addTorque(state, torque_.data());
  for (int i = 0; i < S; ++i) {
    torque_(i) -= 0.5 * inertia_.first(i) * state.velocity[i] * state.velocity[i];
  }
  mobility_ = inertia_.inverse();
  free_ = mobility_ * torque_;
}

bool AccelerationConstraints::factor(const StateView& state) {
  psi_.resize(rowCount());
  Vector gradient(S);
  for (int m = 0; m < rowCount(); ++m) {
    psi_(m) = row(m).calcResidualAndJacobian(state, gradient.data());
    rows_.jacobian().row(m) = gradient;
  }
  return rows_.factor(mobility());
}

bool AccelerationConstraints::calcCorrection(const StateView& state, double* delta, bool is_free) {
  if (!factor(state)) return false;
  for (int i = 0; i < S && is_free; ++i) {
    psi_ += rows_.jacobian().col(i) * (free_(i) - state.acceleration[i]);
  }
  Vector::Map(delta, S) = rows_.toAccelerations() * rows_.solve(-psi_);
  return true;
}

bool AccelerationConstraints::calcMultipliers(const StateView& state, double* lambda) {
  if (!factor(state)) return false;
  ConstraintRows::Vector::Map(lambda, rowCount()) =
      rows_.solve(rows_.jacobian() * (Vector::Map(state.acceleration, S) - free_));
  return true;
}

double AccelerationConstraints::calcRounding(const StateView& state) const {
  const double* const size = terms_.evaluate(state);
  double largest = 0.0;
  for (int m = 0; m < rowCount(); ++m) {
    Vector C(S);
    if (size[m] == 0.0) continue;
    row(m).calcResidualAndJacobian(state, C.data());
    const Vector B = mobility() * C;
    largest = std::max(largest, size[m] * B.cwiseAbs().maxCoeff() / B.dot(C));
  }
  return 16.0 * std::numeric_limits<double>::epsilon() * largest;
}

}  // namespace variator_sim
