/// Saves the current state of a motion, and continues from a saved one.
#include <algorithm>
#include <string>

#include "motion/motion.h"

namespace variator_sim {

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
  finder.enterInputs(state.signal, state.time);
  std::string fault;
  // A saved state that is consistent continues to the bit; a written one is polished.
  const bool is_saved = state.history.exists && finder.accept(state, false);
  if (is_saved || finder.accept(state, project)) {
    const MotionStatus& result = is_saved
                                     ? beginFrom(state, finder.valuesOf(state), state.acceleration)
                                     : beginFrom(state, finder.x(), finder.acceleration());
    if (!result.ok()) {
      fault = std::string("the motion cannot go on from there: ") + toString(result.reason);
    }
  } else {
    fault = finder.describeInconsistency(state);
  }
  if (!fault.empty()) beginFrom(before, finder.valuesOf(before), before.acceleration);
  return fault;
}

}  // namespace variator_sim
