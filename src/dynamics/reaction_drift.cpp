#include "dynamics/reaction_drift.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/dense.h"

namespace variator_sim {

void ReactionDrift::note(const StepNode& node) {
  const Inertia& inertia = drivetrain_.inertia();
  kept_.exists = exists_ && (inertia.isConstant() || inertia.isDiagonal());
  if (!kept_.exists) return;
  drivetrain_.calcReaction(view(node.time, node.x), node.torque.data(), kept_.value);
  for (int i = 0; i < S; ++i) {
    if (!inertia.isConstant()) kept_.value[i] /= std::sqrt(inertia.entry(i, i));
    kept_.is_free[i] = !drivetrain_.readsColumn(i);
  }
}

void ReactionDrift::noteRows(const double (*C)[kMaxShafts]) {
  if (!kept_.exists || drivetrain_.hasConstantJacobian()) return;
  kept_.exists = false;
  for (int i = 0; i < S; ++i) {
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      kept_.is_free[i] = kept_.is_free[i] && C[m][i] == 0.0;
    }
    kept_.exists = kept_.exists || kept_.is_free[i];
  }
}

bool ReactionDrift::answersSteeply(const StepNode& node) {
  double left[kMaxShafts];  // N m, remaining allowance
  for (int i = 0; i < S; ++i) {
    left[i] = drivetrain_.inertia().entry(i, i) * tolerance_.of(node.x[2 * S + i]);
  }
  const auto answers = [&](double time, const State& x) {
    double torque[kMaxShafts];
    drivetrain_.calcTorque(view(time, x), torque);
    for (int i = 0; i < S; ++i) {
      left[i] -= std::abs(torque[i] - node.torque[i]);
      if (!(left[i] >= 0.0)) return true;
    }
    return false;
  };
  bool is_steep = false;
  if (drivetrain_.torquesReadTime()) {
    constexpr double kUlps = 8.0 * std::numeric_limits<double>::epsilon();
    const double size = std::abs(node.time) + std::abs(drivetrain_.origin());
    is_steep = answers(node.time - kUlps * size, node.x);
  }
  State x = node.x;
  for (int n = drivetrain_.readsAngles() ? 0 : S; n < 2 * S && !is_steep; ++n) {
    x[n] += tolerance_.of(x[n]);
    is_steep = answers(node.time, x);
    x[n] = node.x[n];
  }
  view(node.time, node.x);  // brings J back
  return is_steep;
}

bool ReactionDrift::calcLost(const StepNode& node, double* change) {
  double lost[kMaxShafts];  // R less R at the start
  double lambda[kMaxRows] = {};
  const StateView state = view(node.time, node.x);
  drivetrain_.calcReaction(state, node.torque.data(), lost);
  const Inertia& inertia = drivetrain_.inertia();
  const bool is_constant = drivetrain_.hasConstantJacobian();
  for (int i = 0; i < S; ++i) {
    lost[i] -= kept_.value[i] * (inertia.isConstant() ? 1.0 : std::sqrt(inertia.entry(i, i)));
    if (!is_constant && !kept_.is_free[i]) lost[i] = 0.0;
  }
  if (!is_constant || !drivetrain_.solver().isFactored()) {
    double unused[kMaxRows] = {};
    if (!drivetrain_.calcRows(state, unused)) return false;
  }
  drivetrain_.calcOutOfRange(lost, lambda, change);
  return true;
}

double ReactionDrift::measure(const StepNode& node, const double* change) const {
  double largest = 0.0;
  for (int i = 0; i < S; ++i) {
    largest = std::max(largest, std::abs(change[i]) / tolerance_.of(node.x[2 * S + i]));
  }
  return largest;
}

void ReactionDrift::correct(StepNode& node, double most) {
  double change[kMaxShafts];
  if (!kept_.exists || !calcLost(node, change)) return;
  double largest = measure(node, change);
  const bool is_cut = largest > most && answersSteeply(node);
  for (int n = 0; n < 10 && is_cut && largest > most; ++n) {
    if (!moveVelocities(node, change, largest, most) || !calcLost(node, change)) break;
    largest = measure(node, change);
  }
  const double part = is_cut ? std::min(1.0, most / largest) : 1.0;
  for (int i = 0; i < S; ++i) node.x[2 * S + i] += part * change[i];
}

bool ReactionDrift::moveVelocities(StepNode& node, const double* change, double largest,
                                   double most) {
  // delta_omega = sum z_j d_j of directions d_j with C d_j = 0 moves the change to
  //     change + E z,   E_j = J^-1 (dQ/domega d_j) without its part in the range of C^T,
  // and with delta_epsilon = change + E z
  //     |delta_epsilon / tolerance|^2 + |z / tolerance|^2 is least.
  DenseMatrix E(S, S);
  DenseMatrix directions(S, S);
  DenseVector weight(S);
  double rate[kMaxShafts];
  double answer[kMaxShafts];
  double lambda[kMaxRows] = {};
  double acceleration[kMaxShafts] = {};
  StateView state = view(node.time, node.x);
  state.acceleration = acceleration;
  drivetrain_.calcTorqueRate(state, rate);
  double allowed = std::numeric_limits<double>::infinity();
  for (int j = 0; j < S; ++j) {
    allowed = std::min(allowed, tolerance_.of(node.x[2 * S + j]));
    weight(j) = std::pow(tolerance_.of(node.x[S + j]), 2);
    double unit[kMaxShafts] = {};
    unit[j] = -1.0;
    drivetrain_.inertia().multiply(unit, answer);
    drivetrain_.calcOutOfRange(answer, lambda, directions.col(j).data());
    std::copy_n(directions.col(j).data(), S, acceleration);
    drivetrain_.calcTorqueRate(state, answer);
    for (int i = 0; i < S; ++i) answer[i] = rate[i] - answer[i];
    drivetrain_.calcOutOfRange(answer, lambda, E.col(j).data());
  }
  DenseMatrix M = E * weight.asDiagonal() * E.transpose();
  M.diagonal().array() += allowed * allowed;
  const DenseVector mu = solveLu(M, Eigen::Map<const DenseVector>(change, S));
  const DenseVector moved = directions * (weight.asDiagonal() * (E.transpose() * mu));
  double tolerances = most;
  for (int i = 0; i < S; ++i) {
    tolerances = std::max(tolerances, std::abs(moved(i)) / tolerance_.of(node.x[S + i]));
  }
  StepNode tried = node;
  // A layer may lie on the way.
  constexpr int kHalvings = 30;
  for (int n = 0; n < kHalvings; ++n) {
    const double part = std::ldexp(most / tolerances, -n);
    for (int i = 0; i < S; ++i) tried.x[S + i] = node.x[S + i] - part * moved(i);
    double left[kMaxShafts];
    drivetrain_.calcTorque(view(tried.time, tried.x), tried.torque.data());
    if (!tried.x.isFinite() || !calcLost(tried, left)) continue;
    if (measure(tried, left) <= (1.0 - 0.5 * part) * largest) {
      node = tried;
      return true;
    }
  }
  view(node.time, node.x);
  return false;
}

}  // namespace variator_sim
