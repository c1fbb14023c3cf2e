/// The present of a motion as a state that is saved, and from which one goes on.
#include <algorithm>
#include <string>

#include "motion/motion.h"

namespace variator_sim {

void Motion::noteState(const double* angle, const double* velocity, const double* acceleration,
                       MotionState* state) {
  const int S = system_.shafts();
  state->time = time_;
  std::copy_n(angle, S, state->angle);
  std::copy_n(velocity, S, state->velocity);
  std::copy_n(acceleration, S, state->acceleration);
  for (int i = 0; i < drivetrain_.inputCount(); ++i) {
    state->signal[i] = drivetrain_.signal(i);
    state->signal[i].moveOrigin(presentTime());
    state->last_command[i] = commands_.lastTime(i);
  }
}

bool Motion::peekState(MotionState* state) {
  const Sample& now = sample();
  if (!status().ok()) return false;
  *state = MotionState{};
  noteState(now.angle, now.velocity, now.acceleration, state);
  return true;
}

bool Motion::saveState(MotionState* state) {
  carryOutCommands();
  if (!status().ok()) return false;
  if (integrator_.isStart()) energy_.begin(integrator_.front(), integrator_.rows());
  StepNode here = integrator_.front();
  if (integrator_.isSleeping() || isInsideStep()) {
    if (!integrator_.reach(presentTime(), &here)) {
      time_ = status().time;
      return false;
    }
    cutEnergy(here);
  }
  // A motion that stands just behind an edge goes on from there, as that which is restored does.
  if (here.time > presentTime()) time_ = integrator_.origin().absolute(here.time);
  integrator_.cutAt(time_, here);
  noteState(here.x.begin(), here.x.begin() + system_.shafts(),
            system_.view(0.0, here.x).acceleration, state);
  state->history = integrator_.history();
  state->history.energy = energy_.account();
  return beginFrom(*state, here.x, state->acceleration).ok();
}

const MotionStatus& Motion::beginFrom(const MotionState& state, const State& x,
                                      const double* epsilon) {
  time_ = state.time;
  forgetSample();
  commands_.reset();
  for (int i = 0; i < drivetrain_.inputCount(); ++i) {
    drivetrain_.signal(i) = state.signal[i];
    commands_.setLastTime(i, state.last_command[i]);
  }
  integrator_.beginFrom(time_, x, epsilon, state.history);
  if (state.history.exists) {
    energy_.resume(state.history.energy, time_);
  } else {
    energy_.begin(integrator_.front(), integrator_.rows());
  }
  return status();
}

std::string Motion::setState(const MotionState& state, bool project) {
  MotionState before;
  if (!saveState(&before)) return "the motion has stopped";
  for (int i = 0; i < drivetrain_.inputCount(); ++i) drivetrain_.signal(i) = state.signal[i];
  drivetrain_.setOrigin(state.time);
  drivetrain_.refreshInputs(0.0);
  const int S = system_.shafts();
  const bool has_history = state.history.exists;
  const auto stateOf = [&](const MotionState& from) {
    State x(system_.size());
    std::copy_n(from.angle, S, x.begin());
    std::copy_n(from.velocity, S, x.begin() + S);
    if (x.size() > 2 * S) std::copy_n(from.acceleration, S, x.begin() + 2 * S);
    return x;
  };
  Start start(system_);
  double epsilon[kMaxShafts];
  const auto accept = [&](bool may_move) {
    start.x = stateOf(state);
    std::copy_n(state.acceleration, S, epsilon);
    start.result = system_.accept(0.0, may_move, state.is_acceleration_given || has_history,
                                  start.x, epsilon, start.nearest, &start.velocities_at_fault);
    return start.result == InitialResult::kConsistent;
  };
  std::string fault;
  // A saved state that is consistent goes on to the bit; a written one is polished.
  const bool is_saved = has_history && accept(false);
  if (is_saved || accept(project)) {
    const MotionStatus result = is_saved ? beginFrom(state, stateOf(state), state.acceleration)
                                         : beginFrom(state, start.x, epsilon);
    if (result.ok()) return "";
    fault = std::string("the motion cannot go on from there: ") + toString(result.reason);
  } else {
    start.x = stateOf(state);
    fault = describeInconsistency(system_, start, state.acceleration);
  }
  beginFrom(before, stateOf(before), before.acceleration);
  return fault;
}

}  // namespace variator_sim
