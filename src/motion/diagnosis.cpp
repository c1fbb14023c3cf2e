#include "motion/diagnosis.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

namespace {

State goOn(const StepNode& front, double h) {
  State x = front.x;
  for (int i = 0; i < x.size(); ++i) x[i] += h * front.dxdt[i];
  return x;
}

/// Names the first guard whose branch changes within `reach` of the front, on either side.
void nameGuard(System& system, const StepNode& front, double reach, MotionStatus* status) {
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

/// Looks for another branch of accelerations within `reach` of the front, beginning at `least`: the
/// fold at which a branch ends lies within the shortest step.
bool leapsAhead(System& system, const StepNode& front, double least, double reach) {
  StepNode ahead = front;
  const int tens = static_cast<int>(std::ceil(std::log10(reach / least)));
  for (int n = 0; n <= tens; ++n) {
    const double h = std::min(reach, least * std::pow(10.0, n));
    ahead.time = front.time + h;
    ahead.x = goOn(front, h);
    system(ahead.x, ahead.dxdt, ahead.time);
    if (!ahead.dxdt.isFinite()) return false;
    if (system.haveAccelerationsLeapt(front, ahead)) return true;
  }
  return false;
}

}  // namespace

void diagnoseStop(System& system, const StepNode& front, const double* longest,
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
    // If C goes to zero like sqrt(t* - t), the step underflows first, at C ~ 1e-8.
    const double left =
        std::sqrt(drivetrain.solver().rowLengthSquared(m) / std::max(longest[m], 1e-300));
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
  if (leapsAhead(system, front, least, 1e5 * least)) {
    status->reason = StopReason::kProjectionFailed;
    return;
  }
  for (int i = 0; i < front.x.size(); ++i) {
    const double rate = std::abs(front.dxdt[i]) / std::max(1.0, std::abs(front.x[i]));
    status->measure = std::max(status->measure, rate);
  }
  nameGuard(system, front, 1e5 * least, status);
}

bool nameBadValue(System& system, double t, const State& x, MotionStatus* status) {
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

MotionStatus diagnoseStart(System& system, const Start& start) {
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

}  // namespace variator_sim
