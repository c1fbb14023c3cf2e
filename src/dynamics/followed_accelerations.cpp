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

MotionStatus FollowedAccelerations::jump(StateView state, const double* u0, const double* u1) {
  double input[kMaxInputs];
  state.input = input;
  return follow(state, [&](double part, double* torque) {
    for (int i = 0; i < drivetrain_.inputCount(); ++i) input[i] = u0[i] + part * (u1[i] - u0[i]);
    drivetrain_.calcFreeTorque(state, torque);
  });
}

MotionStatus FollowedAccelerations::jumpTorque(const StateView& state, const double* torque_jump) {
  if (is_linear_) return {};  // the solution is unique
  return follow(state, [&](double part, double* torque) {
    drivetrain_.calcFreeTorque(state, torque);
    for (int i = 0; i < S; ++i) torque[i] -= (1.0 - part) * torque_jump[i];
  });
}

template <class MoveTo>
MotionStatus FollowedAccelerations::follow(const StateView& state, MoveTo move_to) {
  constexpr double kLeastPart = 1e-6;
  // Solves for the point at `part` of the jump, from the guess, and stores it as the next guess.
  const auto goTo = [&](double part) {
    double torque[kMaxShafts];
    move_to(part, torque);
    calc(state, torque);
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(epsilon_[i])) return false;
    }
    std::copy(epsilon_, epsilon_ + S, guess_);
    if (!is_linear_) std::copy_n(multipliers_, drivetrain_.constraintCount(), lambda_guess_);
    return true;
  };
  MotionStatus failed;
  failed.reason = StopReason::kJumpFailed;
  if (is_linear_) return goTo(1.0) ? MotionStatus{} : failed;
  goTo(0.0);  // the guess is slightly older
  double part = 1.0;
  for (double done = 0.0; done < 1.0;) {
    const double next = std::min(1.0, done + part);
    double guess[kMaxShafts];
    double lambda_guess[kMaxRows];
    double at_once[kMaxShafts];
    std::copy_n(guess_, S, guess);
    std::copy_n(lambda_guess_, kMaxRows, lambda_guess);
    const auto goBack = [&] {
      std::copy_n(guess, S, guess_);
      std::copy_n(lambda_guess, kMaxRows, lambda_guess_);
    };
    const bool is_there = goTo(next);
    std::copy_n(epsilon_, S, at_once);
    goBack();
    if (is_there && goTo(0.5 * (done + next)) && goTo(next) && areNear(at_once)) {
      done = next;
      part *= 2.0;
      continue;
    }
    goBack();
    part *= 0.25;
    if (!(part > kLeastPart)) return failed;
  }
  return {};
}

void FollowedAccelerations::calcRateInCorner(const StateView& state, double* lambda,
                                             double* reaction_rate) {
  double eta[kMaxShafts];
  initial_solver_.solver().calcJerk(state, corner_, multipliers_, eta, reaction_rate);
  std::copy_n(multipliers_, drivetrain_.constraintCount(), lambda);
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
  if (tangent_) {
    tangent_->calcTorque(state, torque);
    drivetrain_.subtractInertialTorque(state, torque);
  } else {
    drivetrain_.calcFreeTorque(state, torque);
  }
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
    if (initial_solver_.solver().continueFrom(state, torque, epsilon_, multipliers_, &corner_)) {
      return;
    }
  }
  std::fill(epsilon_, epsilon_ + S, std::numeric_limits<double>::quiet_NaN());
}

}  // namespace variator_sim
