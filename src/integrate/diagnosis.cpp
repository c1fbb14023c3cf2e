#include "integrate/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace variator_sim {

namespace {

State goOn(const StepNode& front, double h) {
  State x = front.x;
  for (int i = 0; i < x.size(); ++i) x[i] += h * front.dxdt[i];
  return x;
}

/// Names the first guard whose branch changes within `reach` of the front, on either side.
void nameGuard(PrincipleSystem& system, const StepNode& front, double reach, MotionStatus* status) {
  const Drivetrain& drivetrain = system.drivetrain();
  const auto branchAt = [&](std::size_t guard, double h) {
    return drivetrain.guards()[guard]->branch(system.view(front.time + h, goOn(front, h)));
  };
  for (std::size_t guard = 0; guard < drivetrain.guards().size(); ++guard) {
    const int here = branchAt(guard, 0.0);
    if (branchAt(guard, -reach) == here && branchAt(guard, reach) == here) continue;
    status->guard = static_cast<int>(guard);
    status->torque = drivetrain.guardOwner(status->guard).torque;
    status->constraint = drivetrain.guardOwner(status->guard).constraint;
    return;
  }
}

}  // namespace

void diagnoseStop(PrincipleSystem& system, const StepNode& front, const RowWatch& rows,
                  MotionStatus* status) {
  Drivetrain& drivetrain = system.drivetrain();
  if (nameBadValue(system, front.time, front.x, status)) return;
  const StateView state = system.view(front.time, front.x);
  double c0[kMaxRows] = {};
  if (!drivetrain.calcRows(state, c0)) {
    status->reason = StopReason::kSingularConstraint;
    status->constraint = drivetrain.solver().singularRow();
    status->measure = drivetrain.solver().singularMeasure();
    return;
  }
  // The step underflows before the rank is lost outright: eta grows without bound near there.
  const double pivot = drivetrain.solver().calcSmallestPivot(&status->constraint);
  if (pivot < 1e-9) {
    status->reason = StopReason::kSingularConstraint;
    status->measure = pivot;
    return;
  }
  status->constraint = -1;
  for (int m = 0; m < drivetrain.constraintCount(); ++m) {
    // Where C goes to zero like sqrt(t* - t) the step underflows first, at C ~ 1e-8.
    const double left =
        std::sqrt(drivetrain.solver().rowLengthSquared(m) / std::max(rows.reference(m), 1e-300));
    if (left < 1e-5) {
      status->reason = StopReason::kSingularConstraint;
      status->constraint = m;
      status->measure = left;
      return;
    }
  }
  // Just ahead of the front: does a component leave its domain there?
  const double least = 1e-14 * std::max(1.0, std::abs(front.time));
  double h = least;
  for (int decade = 0; decade < 12; ++decade, h *= 10.0) {
    const State ahead = goOn(front, h);
    if (!ahead.isFinite()) break;
    if (nameBadValue(system, front.time + h, ahead, status)) return;
  }
  if (status->reason != StopReason::kStepUnderflow) return;
  for (int i = 0; i < front.x.size(); ++i) {
    const double rate = std::abs(front.dxdt[i]) / std::max(1.0, std::abs(front.x[i]));
    status->measure = std::max(status->measure, rate);
  }
  nameGuard(system, front, 1e5 * least, status);
}

bool nameBadValue(PrincipleSystem& system, double t, const State& x, MotionStatus* status) {
  const StateView state = system.view(t, x);
  bool solved = true;
  for (int i = 0; i < system.shafts(); ++i) solved = solved && std::isfinite(state.acceleration[i]);
  if (system.drivetrain().findNonFinite(state, &status->torque, &status->constraint)) {
    status->reason = StopReason::kNonFiniteValue;
    return true;
  }
  if (!solved) status->reason = StopReason::kProjectionFailed;
  return !solved;
}

MotionStatus diagnoseStart(PrincipleSystem& system, const Start& start) {
  Drivetrain& drivetrain = system.drivetrain();
  MotionStatus status;
  switch (start.result) {
    case InitialResult::kConsistent:
      break;
    case InitialResult::kSingular:
      status.reason = StopReason::kSingularConstraint;
      status.constraint = start.velocities_at_fault ? drivetrain.singularVelocityConstraint()
                                                    : drivetrain.singularAccelerationConstraint();
      // (Of constraints of order 3 only the solver of all of them knows.)
      if (status.constraint < 0) status.constraint = drivetrain.solver().singularRow();
      break;
    case InitialResult::kNonFinite:
      status.reason = StopReason::kNonFiniteValue;
      drivetrain.findNonFinite(system.view(0.0, start.x), &status.torque, &status.constraint);
      break;
    case InitialResult::kInconsistent:
    case InitialResult::kNotFound:
    case InitialResult::kNotUnique:
    case InitialResult::kDoubtful:
      status.reason = StopReason::kProjectionFailed;
      break;
  }
  return status;
}

namespace {

/// " residual of 'variator' = 0.1, ..", of each constraint that a start has to satisfy.
std::string listResiduals(const Drivetrain& drivetrain, bool of_velocities,
                          const StateView& state) {
  std::string text;
  for (int m : of_velocities ? drivetrain.velocityRows() : drivetrain.accelerationRows()) {
    double C[kMaxShafts];
    const Constraint& constraint = drivetrain.constraint(m);
    text += (text.empty() ? " residual of '" : ", residual of '") + constraint.name() + "' = " +
            formatNumber(of_velocities ? constraint.calcResidual(state)
                                       : constraint.calcResidualAndJacobian(state, C));
  }
  return text;
}

}  // namespace

std::string describeInconsistency(PrincipleSystem& system, const Start& start,
                                  const double* given) {
  const int S = system.shafts();
  const bool of_velocities = start.velocities_at_fault;
  const std::string what = of_velocities ? "velocities" : "accelerations";
  StateView state = system.view(0.0, start.x);
  if (!of_velocities) state.acceleration = given;
  if (start.result == InitialResult::kNotUnique || start.result == InitialResult::kDoubtful) {
    return "which accelerations have the least reaction is not certain; give them";
  }
  const std::string values = formatNumbers(of_velocities ? state.velocity : given, S);
  const std::string residuals = listResiduals(system.drivetrain(), of_velocities, state);
  if (start.result != InitialResult::kInconsistent) {
    return "no " + what + " that satisfy the constraints were found near " + values +
           " (there:" + residuals + ")";
  }
  return "the " + what + " " + values +
         " do not satisfy the constraints or the principle:" + residuals +
         "; the nearest consistent " + what + " are " + formatNumbers(start.nearest, S) +
         " (set these, or have them projected)";
}

void throwInitialError(PrincipleSystem& system, const Scene& scene, const Start& start) {
  const int S = system.shafts();
  const bool of_velocities = start.velocities_at_fault;
  const std::string what = of_velocities ? "velocities" : "accelerations";
  const std::vector<double>& given =
      of_velocities ? scene.initial.velocity : scene.initial.acceleration;
  StateView state = system.view(0.0, start.x);
  std::string text;
  if (start.result == InitialResult::kNotUnique || start.result == InitialResult::kDoubtful) {
    text = start.result == InitialResult::kNotUnique
               ? "more than one has the least reaction, and they lead to different "
                 "motions: "
               : "which one has the least reaction is not certain, the constraints "
                 "have too many like these: ";
    for (int n = 0; n < system.search().candidateCount(); ++n) {
      const auto& candidate = system.search().candidate(n);
      text += (n > 0 ? ", " : "") + formatNumbers(candidate.epsilon, S) +
              " with 1/2 R^T J^-1 R = " + formatNumber(candidate.reaction);
    }
    text += "; give 'initial/acceleration'";
  } else if (start.result != InitialResult::kInconsistent) {
    text = "no " + what + " that satisfy the constraints were found " +
           (given.empty() ? "from the free accelerations; give 'initial/acceleration' (there:"
                          : "near those given (there:") +
           listResiduals(system.drivetrain(), of_velocities, state) + ")";
  } else {
    (of_velocities ? state.velocity : state.acceleration) = given.data();
    text = formatNumbers(given.data(), S) +
           (scene.principle == Principle::kGauss && !of_velocities
                ? " is not what the principle 'gauss' gives:"
                : " does not satisfy the constraints:") +
           listResiduals(system.drivetrain(), of_velocities, state) + "; the nearest consistent " +
           what + " are " + formatNumbers(start.nearest, S) +
           " (write these, or set 'initial/project: true' to start there)";
  }
  throw SceneError(of_velocities ? "initial/velocity" : "initial/acceleration",
                   text + scene.extreme_numbers);
}

}  // namespace variator_sim
