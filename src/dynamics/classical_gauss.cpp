#include "dynamics/classical_gauss.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

ClassicalGauss::ClassicalGauss(const Scene& scene, const Shortcuts& shortcuts,
                               const PrincipleSystem* like)
    : PrincipleSystem(scene, shortcuts, like, 2, false) {
  derive_ = deriveOf<ClassicalGauss>;
  for (const ConstraintPtr& constraint : scene.constraints) {
    linear_ = linear_ && constraint->nonlinearAccelerations() == 0;
  }
}

StateView ClassicalGauss::view(double t, const State& x) {
  const StateView state = drivetrain_.view(t, x.data(), x.data() + S, epsilon_);
  calcAccelerations(state);
  return state;
}

void ClassicalGauss::derive(const State& x, State& dxdt, double t) {
  drivetrain_.countRightHandSide();
  const StateView state = view(t, x);
  if (watch_ != nullptr) watch_->note(state);
  for (int i = 0; i < S; ++i) {
    dxdt[i] = x[S + i];
    dxdt[S + i] = epsilon_[i];
  }
}

void ClassicalGauss::calcStageResidual(double t, const State& x, const double* rate,
                                       const Linearization& linearization, double* residual) {
  if (keepsConstraintsInStages()) {
    drivetrain_.countRightHandSide();
    const StateView state = drivetrain_.view(t, x.data(), x.data() + S, rate);
    if (!drivetrain_.calcAccelerationResidual(state, linearization.projector(),
                                              linearization.pull(), residual)) {
      std::fill(residual, residual + S, std::numeric_limits<double>::quiet_NaN());
    }
    return;
  }
  System::calcStageResidual(t, x, rate, linearization, residual);
}

void ClassicalGauss::calcStageLinearization(double t, const State& x, const State& dxdt,
                                            Linearization& linearization) {
  if (!keepsConstraintsInStages()) {
    System::calcStageLinearization(t, x, dxdt, linearization);
    return;
  }
  linearization.mass().setIdentity();
  const StateView state = drivetrain_.view(t, x.data(), x.data() + S, dxdt.data() + S);
  double lambda[kMaxRows] = {};
  calcMultipliers(state, lambda);
  double derivatives[2 * kMaxShafts * kMaxShafts];
  drivetrain_.calcAccelerationDerivatives(state, lambda, linearization.projector(),
                                          linearization.pull(), derivatives);
  for (int i = 0; i < S; ++i) {
    for (int q = 0; q < 2 * S; ++q) {
      linearization.block(q / S)(i, q % S) = -derivatives[q * S + i];
    }
  }
}

ProjectionResult ClassicalGauss::projectStiffly(double t, double h, const State& slope, State& x,
                                                State& moved, std::uint64_t* iterations) {
  if (!keepsConstraintsInStages()) return project(t, x, moved, iterations);
  double both[2 * kMaxShafts];  // velocities, accelerations
  double change[2 * kMaxShafts] = {};
  for (int i = 0; i < S; ++i) {
    both[i] = x[S + i];
    both[S + i] = slope[S + i];
  }
  const StateView state = drivetrain_.view(t, x.data(), both, both + S);
  const ProjectionResult result = iterateProjection(
      2 * S, [&](double* delta) { return drivetrain_.calcStiffProjection(state, h, delta); }, both,
      change, iterations);
  moved.fill(0.0);
  for (int i = 0; i < S; ++i) {
    x[S + i] = both[i];
    moved[S + i] = change[i];
  }
  return result;
}

ProjectionResult ClassicalGauss::project(double t, State& x, State& moved,
                                         std::uint64_t* iterations) {
  moved.fill(0.0);
  if (!drivetrain_.hasVelocityRows()) return ProjectionResult::kConverged;
  const StateView state = drivetrain_.view(t, x.data(), x.data() + S, epsilon_);
  return projectVelocities(drivetrain_, state, x.data() + S, moved.data() + S, iterations);
}

InitialResult ClassicalGauss::start(State& x, double* nearest, bool* velocities_at_fault) {
  std::copy(scene_.initial.angle.begin(), scene_.initial.angle.end(), x.begin());
  std::copy(scene_.initial.velocity.begin(), scene_.initial.velocity.end(), x.begin() + S);
  const StateView state = drivetrain_.view(0.0, x.data(), x.data() + S, epsilon_);
  const InitialResult velocities =
      initial_solver_.acceptVelocities(state, scene_.initial.project, x.data() + S, nearest);
  *velocities_at_fault = velocities != InitialResult::kConsistent;
  if (*velocities_at_fault) return velocities;
  InitialResult result = initial_solver_.findLeastReaction(state, epsilon_);
  if (!scene_.initial.acceleration.empty() &&
      (result == InitialResult::kNotUnique || result == InitialResult::kDoubtful)) {
    // The given accelerations select one of the stationary points.
    std::copy_n(scene_.initial.acceleration.begin(), S, epsilon_);
    std::copy(epsilon_, epsilon_ + S, guess_);
    calcMultipliers(state, lambda_guess_);
    calcAccelerations(state);
    if (!std::isfinite(epsilon_[0])) return InitialResult::kNotFound;
    result = InitialResult::kConsistent;
  }
  std::copy(epsilon_, epsilon_ + S, guess_);
  std::copy(epsilon_, epsilon_ + S, nearest);
  calcMultipliers(state, lambda_guess_);
  if (result != InitialResult::kConsistent || scene_.initial.acceleration.empty() ||
      scene_.initial.project) {
    return result;
  }
  // The accelerations follow from the state here; given ones must agree with them.
  return areNear(scene_.initial.acceleration.data(), epsilon_) ? result
                                                               : InitialResult::kInconsistent;
}

bool ClassicalGauss::areNear(const double* given, const double* epsilon) const {
  for (int i = 0; i < S; ++i) {
    if (!(std::abs(given[i] - epsilon[i]) <= 1e-6 * std::max(1.0, std::abs(given[i])))) {
      return false;
    }
  }
  return true;
}

InitialResult ClassicalGauss::accept(double t, bool may_move, bool are_given, State& x,
                                     double* epsilon, double* nearest, bool* velocities_at_fault) {
  const StateView state = drivetrain_.view(t, x.data(), x.data() + S, epsilon_);
  const InitialResult velocities =
      initial_solver_.acceptVelocities(state, may_move, x.data() + S, nearest);
  *velocities_at_fault = velocities != InitialResult::kConsistent;
  if (*velocities_at_fault) return velocities;
  if (are_given) {
    std::copy_n(epsilon, S, epsilon_);
    std::copy_n(epsilon, S, guess_);
    std::fill_n(lambda_guess_, kMaxRows, 0.0);
    calcMultipliers(state, lambda_guess_);
    calcAccelerations(state);
  }
  if (!are_given || !std::isfinite(epsilon_[0])) {
    const InitialResult result = initial_solver_.findLeastReaction(state, epsilon_);
    if (result != InitialResult::kConsistent) return result;
  }
  std::copy_n(epsilon_, S, nearest);
  if (are_given && !may_move && !areNear(epsilon, epsilon_)) return InitialResult::kInconsistent;
  std::copy_n(epsilon_, S, epsilon);
  return InitialResult::kConsistent;
}

MotionStatus ClassicalGauss::jump(double t, State& x, const double* u0, const double* u1,
                                  std::uint64_t* /*projections*/) {
  StateView state = drivetrain_.view(t, x.data(), x.data() + S, epsilon_);
  double input[kMaxInputs];
  state.input = input;
  return follow(state, [&](double part, double* torque) {
    for (int i = 0; i < drivetrain_.inputCount(); ++i) input[i] = u0[i] + part * (u1[i] - u0[i]);
    drivetrain_.calcFreeTorque(state, torque);
  });
}

MotionStatus ClassicalGauss::jumpTorque(double t, State& x, const double* torque_jump,
                                        std::uint64_t* /*projections*/) {
  if (linear_) return {};  // the solution is unique
  const StateView state = drivetrain_.view(t, x.data(), x.data() + S, epsilon_);
  return follow(state, [&](double part, double* torque) {
    drivetrain_.calcFreeTorque(state, torque);
    for (int i = 0; i < S; ++i) torque[i] -= (1.0 - part) * torque_jump[i];
  });
}

template <class MoveTo>
MotionStatus ClassicalGauss::follow(const StateView& state, MoveTo move_to) {
  constexpr double kLeastPart = 1e-6;
  // Solves for the point at `part` of the jump, from the guess, and stores it as the next guess.
  const auto goTo = [&](double part) {
    double torque[kMaxShafts];
    move_to(part, torque);
    calcAccelerations(state, torque);
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(epsilon_[i])) return false;
    }
    std::copy(epsilon_, epsilon_ + S, guess_);
    if (!linear_) std::copy_n(multipliers_, drivetrain_.constraintCount(), lambda_guess_);
    return true;
  };
  MotionStatus failed;
  failed.reason = StopReason::kJumpFailed;
  if (linear_) return goTo(1.0) ? MotionStatus{} : failed;
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
    if (is_there && goTo(0.5 * (done + next)) && goTo(next) && areNear(at_once, epsilon_)) {
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

void ClassicalGauss::noteBase(double t, const State& x, const State& dxdt) {
  if (linear_) return;
  std::copy(dxdt.begin() + S, dxdt.end(), guess_);
  calcMultipliers(drivetrain_.view(t, x.data(), x.data() + S, guess_), lambda_guess_);
}

bool ClassicalGauss::calcSample(double t, const State& x, Sample* sample) {
  const StateView state = view(t, x);
  sample->time = t;
  std::copy(x.begin(), x.begin() + S, sample->angle);
  std::copy(x.begin() + S, x.end(), sample->velocity);
  std::copy(epsilon_, epsilon_ + S, sample->acceleration);
  // R = J epsilon + n - Q = C^T lambda
  drivetrain_.calcTorque(state, sample->applied_torque);
  drivetrain_.calcReaction(state, sample->applied_torque, sample->reaction_torque);
  std::fill(sample->reaction_torque_rate, sample->reaction_torque_rate + S, 0.0);
  if (drivetrain_.constraintCount() == 0) return true;
  double c0[kMaxRows] = {};
  if (!drivetrain_.calcRows(state, c0)) return false;
  drivetrain_.calcMultipliers(sample->reaction_torque, sample->multiplier);
  double eta[kMaxShafts];
  bool regular = true;
  if (corner_ == 0) {
    regular =
        drivetrain_.calcFormalJerk(state, sample->multiplier, eta, sample->reaction_torque_rate);
  } else {
    // C is not unique in a corner of psi: the kinks that meet there have their own multipliers.
    regular = initial_solver_.solver().calcJerk(state, corner_, multipliers_, eta,
                                                sample->reaction_torque_rate);
    std::copy_n(multipliers_, drivetrain_.constraintCount(), sample->multiplier);
  }
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    sample->residual[m] = drivetrain_.calcResidual(m, state, eta);
  }
  return regular;
}

void ClassicalGauss::calcMultipliers(const StateView& state, double* lambda) {
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double c0[kMaxRows] = {};
  drivetrain_.calcTorque(state, torque);
  drivetrain_.calcReaction(state, torque, reaction);
  if (drivetrain_.calcRows(state, c0)) drivetrain_.calcMultipliers(reaction, lambda);
}

void ClassicalGauss::calcAccelerations(const StateView& state) {
  double torque[kMaxShafts];
  if (tangent_ != nullptr) {
    tangent_->calcTorque(state, torque);
    drivetrain_.subtractInertialTorque(state, torque);
  } else {
    drivetrain_.calcFreeTorque(state, torque);
  }
  calcAccelerations(state, torque);
}

void ClassicalGauss::calcAccelerations(const StateView& state, const double* torque) {
  if (linear_) {
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
