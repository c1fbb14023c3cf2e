/// Saves the current state of a motion, and continues from a saved one.
#include <algorithm>
#include <string>

#include "motion/motion.h"
#include "motion/stop_message.h"

namespace variator_sim {

namespace {

/// Returns the current state of a motion but for its history.
MotionState stateAtPresent(const Motion& motion, const double* angle, const double* velocity,
                           const double* acceleration) {
  const int S = motion.system.shafts();
  MotionState state;
  state.time = motion.time;
  std::copy_n(angle, S, state.angle);
  std::copy_n(velocity, S, state.velocity);
  std::copy_n(acceleration, S, state.acceleration);
  for (int i = 0; i < motion.drivetrain.inputCount(); ++i) {
    state.signal[i] = motion.drivetrain.signal(i);
    state.signal[i].moveOrigin(motion.presentTime());
    state.last_command[i] = motion.commands.lastTime(i);
  }
  return state;
}

State valuesOf(const MotionState& state, const System& system) {
  const int S = system.shafts();
  State x(system.size());
  std::copy_n(state.angle, S, x.begin());
  std::copy_n(state.velocity, S, x.begin() + S);
  if (x.size() > 2 * S) std::copy_n(state.acceleration, S, x.begin() + 2 * S);
  return x;
}

}  // namespace

bool Simulation::peekState(MotionState* state) {
  motion_->settle();
  const Sample& now = motion_->sample();
  if (!status().ok()) return false;
  *state = stateAtPresent(*motion_, now.angle, now.velocity, now.acceleration);
  return true;
}

bool Simulation::saveState(MotionState* state) {
  Motion& motion = *motion_;
  Integrator& integrator = motion.integrator;
  motion.settle();
  StepNode here(motion.system);
  if (!status().ok() || !motion.cutStep(&here)) return false;
  // A motion just behind an event continues from there, as a restored one does.
  if (here.time > motion.presentTime()) motion.time = integrator.origin().absolute(here.time);
  integrator.cutAt(motion.time, here);
  *state = stateAtPresent(motion, here.x.begin(), here.x.begin() + motion.system.shafts(),
                          motion.system.view(0.0, here.x).acceleration);
  state->history = integrator.history();
  state->history.energy = motion.energy_meter.account();
  return motion.beginFrom(*state, here.x, state->acceleration).ok();
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

std::string Simulation::setState(const MotionState& state, bool project) {
  Motion& motion = *motion_;
  System& system = motion.system;
  MotionState before;
  if (!saveState(&before)) return "the motion has stopped";
  for (int i = 0; i < motion.drivetrain.inputCount(); ++i) {
    motion.drivetrain.signal(i) = state.signal[i];
  }
  motion.drivetrain.setOrigin(state.time);
  motion.drivetrain.refreshInputs(0.0);
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
    const MotionStatus& result = is_saved ? motion.beginFrom(state, given, state.acceleration)
                                          : motion.beginFrom(state, start.x, epsilon);
    if (!result.ok()) {
      fault = std::string("the motion cannot go on from there: ") + toString(result.reason);
    }
  } else {
    start.x = given;
    fault = describeInconsistency(system, start, state.acceleration);
  }
  if (!fault.empty()) {
    motion.beginFrom(before, valuesOf(before, system), before.acceleration);
  } else if (motion.error_estimate) {
    motion.error_estimate->companion().setState(state, project);
    motion.error_estimate->forget();
  }
  return fault;
}

}  // namespace variator_sim
