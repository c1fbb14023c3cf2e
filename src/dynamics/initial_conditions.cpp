#include "dynamics/initial_conditions.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

InitialResult InitialConditionSolver::acceptVelocities(const StateView& state, bool may_move,
                                                       double* omega, double* nearest) {
  std::copy(omega, omega + S, nearest);
  StateView moving = state;
  moving.velocity = nearest;
  double moved[kMaxShafts];
  std::uint64_t iterations = 0;
  switch (projectVelocities(drivetrain_, moving, nearest, moved, &iterations)) {
    case ProjectionResult::kSingular:
      return InitialResult::kSingular;
    case ProjectionResult::kDiverged:
      return InitialResult::kNotFound;
    case ProjectionResult::kConverged:
      break;
  }
  return acceptNearest(may_move, omega, nearest);
}

InitialResult InitialConditionSolver::findLeastReaction(const StateView& state, double* epsilon) {
  double torque[kMaxShafts];
  double free[kMaxShafts];
  search_.forget();
  drivetrain_.calcFreeTorque(state, torque);
  drivetrain_.inertia().solve(torque, free);
  for (int i = 0; i < S; ++i) {
    if (!std::isfinite(free[i])) return InitialResult::kNonFinite;
    epsilon[i] = free[i];
  }
  if (!drivetrain_.hasAccelerationRows()) return InitialResult::kConsistent;
  double multipliers[kMaxShafts] = {};
  bool is_found = solver_.solve(state, torque, 0, epsilon, multipliers);
  if (!is_found) {
    // Far from psi = 0 Newton's iteration may lead away; damped steps to the solution of the
    // linearised constraints come near first.
    std::copy_n(free, S, epsilon);
    approach(state, free, epsilon);
    std::fill_n(multipliers, S, 0.0);
    is_found = solver_.solve(state, torque, 0, epsilon, multipliers);
  }
  if (drivetrain_.nonlinearAccelerations().none()) {
    if (is_found) return InitialResult::kConsistent;
    std::copy_n(free, S, epsilon);
    return explain(state, epsilon);
  }
  using Verdict = LeastReactionSearch::Verdict;
  const Verdict verdict = search_.find(state, torque, free, is_found ? epsilon : nullptr);
  const bool has_any = search_.candidateCount() > 0;
  std::copy_n(has_any ? search_.candidate(0).epsilon : free, S, epsilon);
  switch (verdict) {
    case Verdict::kFound:
      return InitialResult::kConsistent;
    case Verdict::kTie:
      return InitialResult::kNotUnique;
    case Verdict::kDoubtful:
      return InitialResult::kDoubtful;
    case Verdict::kNone:
      break;
  }
  return explain(state, epsilon);
}

InitialResult InitialConditionSolver::acceptAccelerations(const StateView& state, bool may_move,
                                                          double* epsilon, double* nearest) {
  std::copy(epsilon, epsilon + S, nearest);
  StateView moving = state;
  moving.acceleration = nearest;
  if (drivetrain_.hasAccelerationRows() && !solver_.retract(moving, nearest)) {
    return explain(state, epsilon);
  }
  return acceptNearest(may_move, epsilon, nearest);
}

InitialResult InitialConditionSolver::acceptNearest(bool may_move, double* values,
                                                    const double* nearest) const {
  double scale = 1.0;
  double distance = 0.0;
  for (int i = 0; i < S; ++i) {
    scale = std::max(scale, std::abs(values[i]));
    distance = std::max(distance, std::abs(nearest[i] - values[i]));
  }
  if (!(distance <= kConsistent * scale) && !may_move) return InitialResult::kInconsistent;
  std::copy(nearest, nearest + S, values);
  return InitialResult::kConsistent;
}

InitialResult InitialConditionSolver::explain(const StateView& state, const double* epsilon) {
  StateView there = state;
  there.acceleration = epsilon;
  int torque;
  int constraint;
  if (drivetrain_.findNonFinite(there, &torque, &constraint)) return InitialResult::kNonFinite;
  // Reports a lost rank only on psi = 0; elsewhere no start was found at all.
  double delta[kMaxShafts];
  if (drivetrain_.calcAccelerationProjection(there, delta)) return InitialResult::kNotFound;
  for (int m : drivetrain_.accelerationRows()) {
    double C[kMaxShafts];
    if (drivetrain_.constraint(m).calcResidualAndJacobian(there, C) != 0.0) {
      return InitialResult::kNotFound;
    }
  }
  return InitialResult::kSingular;
}

void InitialConditionSolver::approach(const StateView& given, const double* free, double* epsilon) {
  StateView state = given;
  state.acceleration = epsilon;
  for (int iteration = 0; iteration < 100; ++iteration) {
    double delta[kMaxShafts];
    if (!drivetrain_.calcLinearizedReaction(state, free, delta)) return;
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(delta[i])) return;
      epsilon[i] += 0.5 * (free[i] + delta[i] - epsilon[i]);
    }
  }
}

}  // namespace variator_sim
