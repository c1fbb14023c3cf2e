#include "dynamics/reaction_drift.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

void ReactionDrift::correct(StepNode& node, double most) {
  if (!kept_.exists) return;
  double lost[kMaxShafts];  // R less R at the start
  double change[kMaxShafts];
  const StateView state = view(node.time, node.x);
  drivetrain_.calcReaction(state, node.torque.data(), lost);
  const Inertia& inertia = drivetrain_.inertia();
  for (int i = 0; i < S; ++i) {
    lost[i] -= kept_.value[i] * (inertia.isConstant() ? 1.0 : std::sqrt(inertia.entry(i, i)));
  }
  // J d_epsilon = C^T lambda - lost, C d_epsilon = 0.
  double lambda[kMaxRows] = {};
  const bool is_constant = drivetrain_.hasConstantJacobian();
  if (!is_constant || !drivetrain_.solver().isFactored()) {
    double unused[kMaxRows] = {};
    if (!drivetrain_.calcRows(state, unused)) return;
  }
  for (int i = 0; i < S && !is_constant; ++i) lost[i] = kept_.is_free[i] ? lost[i] : 0.0;
  drivetrain_.calcOutOfRange(lost, lambda, change);
  double largest = 0.0;
  for (int i = 0; i < S; ++i) {
    largest = std::max(largest, std::abs(change[i]) / tolerance_.of(node.x[2 * S + i]));
  }
  const bool is_cut = largest > most && answersSteeply(node);
  const double part = is_cut ? most / largest : 1.0;
  for (int i = 0; i < S; ++i) node.x[2 * S + i] += part * change[i];
}

}  // namespace variator_sim
