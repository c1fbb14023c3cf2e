#include "dynamics/followed_accelerations.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

InitialResult FollowedAccelerations::start(const StateView& state, const InitialConditions& initial,
                                           double* nearest) {
  const double* const given = initial.acceleration.empty() ? nullptr : initial.acceleration.data();
  InitialResult result = initial_solver_.findLeastReaction(state, epsilon_);
  if (given != nullptr &&
      (result == InitialResult::kNotUnique || result == InitialResult::kDoubtful)) {
    std::copy_n(given, S, epsilon_);
    guess(state, epsilon_);
    calc(state);
    if (!std::isfinite(epsilon_[0])) return InitialResult::kNotFound;
    result = InitialResult::kConsistent;
  }
  guess(state, epsilon_);
  std::copy_n(epsilon_, S, nearest);
  if (result != InitialResult::kConsistent || given == nullptr || initial.project) return result;
  // The accelerations follow from the state here; given ones must agree with them.
  return areNear(given) ? result : InitialResult::kInconsistent;
}

InitialResult FollowedAccelerations::accept(const StateView& state, bool may_move, bool are_given,
                                            double* epsilon, double* nearest) {
  if (are_given) {
    std::copy_n(epsilon, S, epsilon_);
    std::fill_n(lambda_guess_, kMaxRows, 0.0);
    guess(state, epsilon_);
    calc(state);
  }
  if (!are_given || !std::isfinite(epsilon_[0])) {
    const InitialResult result = initial_solver_.findLeastReaction(state, epsilon_);
    if (result != InitialResult::kConsistent) return result;
  }
  std::copy_n(epsilon_, S, nearest);
  if (are_given && !may_move && !areNear(epsilon)) return InitialResult::kInconsistent;
  std::copy_n(epsilon_, S, epsilon);
  return InitialResult::kConsistent;
}

bool FollowedAccelerations::areNear(const double* given) const {
  for (int i = 0; i < S; ++i) {
    if (!(std::abs(given[i] - epsilon_[i]) <= 1e-6 * std::max(1.0, std::abs(given[i])))) {
      return false;
    }
  }
  return true;
}

void FollowedAccelerations::guess(const StateView& state, const double* epsilon) {
  std::copy_n(epsilon, S, guess_);
  calcMultipliers(state, lambda_guess_);
}

void FollowedAccelerations::noteStepStart(double t, const State& x, const double* epsilon) {
  if (!is_linear_) guess(drivetrain_.view(t, x.data(), x.data() + S, epsilon), epsilon);
}

void FollowedAccelerations::calcMultipliers(const StateView& state, double* lambda) {
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double c0[kMaxRows] = {};
  drivetrain_.calcTorque(state, torque);
  drivetrain_.calcReaction(state, torque, reaction);
  if (drivetrain_.calcRows(state, c0)) drivetrain_.calcMultipliers(reaction, lambda);
}

void FollowedAccelerations::calc(const StateView& state) {
  double torque[kMaxShafts];
  drivetrain_.calcFreeTorque(state, torque);
  calc(state, torque);
}

void FollowedAccelerations::calc(const StateView& state, const double* torque) {
  if (is_linear_) {
    // psi = C epsilon + b: with epsilon = 0 the projection's residual is b, and
    // A lambda = -(b + C epsilon_free) is one correction from the free accelerations.
    drivetrain_.inertia().solve(torque, epsilon_);
    if (drivetrain_.constraintCount() == 0) return;
    // (Nearly dependent rows take a few corrections, as in ConstraintSolver::refine.)
    double delta[kMaxShafts];
    bool solved = drivetrain_.calcAccelerationProjection(state, delta);
    for (int i = 0; i < S && solved; ++i) epsilon_[i] += delta[i];
    for (int round = 0; round < 3 && solved && drivetrain_.areAccelerationRowsIll(); ++round) {
      solved = drivetrain_.calcAccelerationProjection(state, delta);
      for (int i = 0; i < S && solved; ++i) epsilon_[i] += delta[i];
    }
    if (solved) return;
  } else {
    // The multipliers belong to the same point: others may lead the iteration to another branch.
    std::copy(guess_, guess_ + S, epsilon_);
    std::fill_n(multipliers_, S, 0.0);
    std::copy_n(lambda_guess_, kMaxRows, multipliers_);
    if (initial_solver_.solver().solve(state, torque, 0, epsilon_, multipliers_)) {
      return;
    }
  }
  std::fill(epsilon_, epsilon_ + S, std::numeric_limits<double>::quiet_NaN());
}

}  // namespace variator_sim
