/// Saves the current state of a motion, and continues from a saved one.
#include <algorithm>
#include <string>

#include "motion/motion.h"
#include "motion/stop_message.h"

namespace variator_sim {

namespace {

State valuesOf(const MotionState& state, const System& system) {
  const int S = system.shafts();
  State x(system.size());
  std::copy_n(state.angle, S, x.begin());
  std::copy_n(state.velocity, S, x.begin() + S);
  if (x.size() > 2 * S) std::copy_n(state.acceleration, S, x.begin() + 2 * S);
  return x;
}

}  // namespace

bool Motion::saveState(MotionState* state) {
  settle();
  StepNode here(system);
  if (!status().ok() || !cutStep(&here)) return false;
  // A motion just behind an event continues from there, as a restored one does.
  if (here.time > presentTime()) time = integrator.origin().absolute(here.time);
  integrator.cutAt(time, here);
  const int S = system.shafts();
  *state = MotionState{};
  state->time = time;
  std::copy_n(here.x.begin(), S, state->angle);
  std::copy_n(here.x.begin() + S, S, state->velocity);
  std::copy_n(system.view(0.0, here.x).acceleration, S, state->acceleration);
  writeInputs(state);
  state->history = integrator.history();
  state->history.energy = energy_meter.account();
  return beginFrom(*state, here.x, state->acceleration).ok();
}

const MotionStatus& Motion::beginFrom(const MotionState& state, const State& x,
                                      const double* epsilon) {
  time = state.time;
  forgetSample();
  commands.reset();
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    drivetrain.signal(i) = state.signal[i];
    commands.setLastTime(i, state.last_command[i]);
  }
  integrator.beginFrom(time, x, epsilon, state.history);
  if (state.history.exists) {
    energy_meter.resume(state.history.energy, time);
  } else {
    energy_meter.begin();
  }
  return status();
}

std::string Motion::setState(const MotionState& state, bool project) {
  MotionState before;
  if (!saveState(&before)) return "the motion has stopped";
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    drivetrain.signal(i) = state.signal[i];
  }
  drivetrain.setOrigin(state.time);
  drivetrain.refreshInputs(0.0);
  const State given = valuesOf(state, system);
  Start start(system);
  double epsilon[kMaxShafts];
  const auto accept = [&](bool may_move) {
    start.x = given;
    std::copy_n(state.acceleration, system.shafts(), epsilon);
    const bool are_given = state.is_acceleration_given || state.history.exists;
    start.result = system.accept(0.0, may_move, are_given, start.x, epsilon, start.nearest,
                                 &start.velocities_at_fault);
    return start.result == InitialResult::kConsistent;
  };
  std::string fault;
  // A saved state that is consistent continues to the bit; a written one is polished.
  const bool is_saved = state.history.exists && accept(false);
  if (is_saved || accept(project)) {
    const MotionStatus& result =
        is_saved ? beginFrom(state, given, state.acceleration) : beginFrom(state, start.x, epsilon);
    if (!result.ok()) {
      fault = std::string("the motion cannot go on from there: ") + toString(result.reason);
    }
  } else {
    start.x = given;
    fault = describeInconsistency(system, start, state.acceleration);
  }
  if (!fault.empty()) {
    beginFrom(before, valuesOf(before, system), before.acceleration);
  }
  return fault;
}

}  // namespace variator_sim
