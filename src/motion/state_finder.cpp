#include "motion/state_finder.h"

#include <algorithm>

#include "motion/stop_message.h"

namespace variator_sim {

StateFinder::StateFinder(const Scene& scene, const StateFinder* like)
    : system_(scene, like != nullptr ? &like->system_ : nullptr), start_(system_) {}

void StateFinder::enterInputs(const CommandSignal* signals, double origin) {
  Drivetrain& drivetrain = system_.drivetrain();
  for (int i = 0; i < drivetrain.inputCount(); ++i) drivetrain.signal(i) = signals[i];
  drivetrain.setOrigin(origin);
  drivetrain.refreshInputs(0.0);
}

bool StateFinder::findFirst() {
  start_.x.fill(0.0);
  start_.result = system_.start(start_.x, start_.nearest, &start_.velocities_at_fault);
  if (start_.result != InitialResult::kConsistent) return false;
  std::copy_n(system_.view(0.0, start_.x).acceleration, system_.shafts(), epsilon_);
  return true;
}

State StateFinder::valuesOf(const MotionState& given) const {
  const int S = system_.shafts();
  State x(system_.size());
  std::copy_n(given.angle, S, x.begin());
  std::copy_n(given.velocity, S, x.begin() + S);
  if (x.size() > 2 * S) std::copy_n(given.acceleration, S, x.begin() + 2 * S);
  return x;
}

bool StateFinder::accept(const MotionState& given, bool may_move) {
  if (tryState(given, 0.0, may_move)) return true;
  if (!given.history.exists || may_move) return false;
  // A state of a motion may lie on an event, the side of which a moment later is its own.
  constexpr double kMoment = 1e-9;  // s
  const Start here = start_;
  if (tryState(given, kMoment, false)) return true;
  start_ = here;
  return false;
}

bool StateFinder::tryState(const MotionState& given, double later, bool may_move) {
  start_.x = valuesOf(given);
  for (int i = 0; i < system_.shafts(); ++i) {
    start_.x[i] += later * given.velocity[i];
    start_.x[system_.shafts() + i] += later * given.acceleration[i];
  }
  std::copy_n(given.acceleration, system_.shafts(), epsilon_);
  const bool are_given = given.is_acceleration_given || given.history.exists;
  start_.result = system_.accept(later, may_move, are_given, start_.x, epsilon_, start_.nearest,
                                 &start_.velocities_at_fault);
  return start_.result == InitialResult::kConsistent;
}

void StateFinder::write(double* state, double* multiplier) {
  const int S = system_.shafts();
  std::copy_n(start_.x.begin(), 2 * S, state);
  std::copy_n(epsilon_, S, state + 2 * S);
  if (system_.integratesTorque() || start_.result != InitialResult::kConsistent) return;
  const StateView view = system_.drivetrain().view(0.0, state, state + S, state + 2 * S);
  system_.accelerations().calcMultipliers(view, multiplier);
}

MotionState StateFinder::found(const MotionState& given) {
  const int S = system_.shafts();
  double state[3 * kMaxShafts];
  MotionState made = given;
  made.history = {};
  write(state, made.history.multiplier);
  std::copy_n(state, S, made.angle);
  std::copy_n(state + S, S, made.velocity);
  std::copy_n(state + 2 * S, S, made.acceleration);
  made.is_acceleration_given = true;
  return made;
}

void StateFinder::requireConsistency() {
  switch (start_.result) {
    case InitialResult::kConsistent:
    case InitialResult::kSingular:
    case InitialResult::kNonFinite:
      return;
    default:
      throwInitialError(system_, system_.scene(), start_);
  }
}

std::string StateFinder::describeInconsistency(const MotionState& given) {
  start_.x = valuesOf(given);
  return variator_sim::describeInconsistency(system_, start_, given.acceleration);
}

void StateFinder::explainStop(const double* state, const double* longest, MotionStatus* status) {
  const int S = system_.shafts();
  StepNode front(system_.size());
  std::copy_n(state, front.x.size(), front.x.begin());
  // Iterations start from these where the accelerations follow from the state.
  State slope(front.x.size());
  std::copy_n(state + 2 * S, S, slope.begin() + S);
  system_.noteBase(0.0, front.x, slope);
  system_(front.x, front.dxdt, 0.0);
  diagnoseStop(system_, front, longest, status);
}

}  // namespace variator_sim
