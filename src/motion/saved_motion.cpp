/// Saves the current state of a motion, and continues from a state of elsewhere.
#include <algorithm>
#include <string>

#include "motion/motion.h"

namespace variator_sim {

bool Motion::peekState(MotionState* state) {
  settle();
  const Sample& now = sample();
  if (!status.ok()) return false;
  *state = MotionState{};
  state->time = time;
  std::copy_n(now.angle, scene.shaftCount(), state->angle);
  std::copy_n(now.velocity, scene.shaftCount(), state->velocity);
  std::copy_n(now.acceleration, scene.shaftCount(), state->acceleration);
  inputs.save(time, state);
  return true;
}

bool Motion::saveState(MotionState* state) {
  settle();
  if (!status.ok() || !cut()) return false;
  // (The end of a step over an event stands for the event, some 1e-9 s before it.)
  time = std::max(time, program.front());
  const int S = scene.shaftCount();
  const int rows = program.text().K;
  const Exchange& it = program.it;
  program.leave();
  inputs.takeMemory(time, it.input);
  *state = MotionState{};
  state->time = time;
  std::copy_n(it.state, S, state->angle);
  std::copy_n(it.state + S, S, state->velocity);
  std::copy_n(it.state + 2 * S, S, state->acceleration);
  inputs.save(time, state);
  MotionState::History& history = state->history;
  history.exists = true;
  history.is_start = is_start_;
  history.is_implicit = program.isImplicit();
  std::copy_n(it.longest, rows, history.longest_row);
  std::copy_n(it.multiplier, rows, history.multiplier);
  for (int h = 0; h < program.text().HOLDS; ++h) {
    const vs_exchanged_hold& hold = it.hold[h];
    history.held[h] = {hold.mode, hold.counts, hold.side, hold.heat};
  }
  std::copy_n(it.armed, kMaxEvents, history.armed);
  history.past = program.past().save();
  std::copy_n(it.reaction, S, history.kept_reaction);
  history.energy = energy.account();
  return goOnFrom(*state, false) == SCENE_OK;
}

scene_status Motion::goOnFrom(const MotionState& state, bool may_move) {
  /// Implicit steps, before series are tried again.
  constexpr int kFewSteps = 3;
  const int S = scene.shaftCount();
  const int rows = program.text().K;
  const MotionState::History& history = state.history;
  Exchange& it = program.it;
  time = state.time;
  status = MotionStatus{};
  inputs.restore(state);
  progress.begin(time);
  std::copy_n(state.angle, S, it.state);
  std::copy_n(state.velocity, S, it.state + S);
  std::copy_n(state.acceleration, S, it.state + 2 * S);
  // (Where it began elsewhere, it would begin there anew.)
  is_start_ = history.is_start && time == scene.initial.time &&
              std::equal(first_, first_ + 3 * S, it.state);
  std::copy_n(history.longest_row, rows, it.longest);
  std::copy_n(history.multiplier, rows, it.multiplier);
  for (int h = 0; h < program.text().HOLDS; ++h) {
    const HeldState& held = history.held[h];
    it.hold[h] = {held.mode, held.counts, held.side, held.heat};
  }
  std::copy_n(history.kept_reaction, S, it.reaction);
  std::copy_n(history.armed, kMaxEvents, it.armed);
  it.time = time;
  it.time_rest = 0.0;
  it.choice = {};
  if (history.is_implicit) {
    it.choice.method = 1;
    it.choice.left = kFewSteps;
  }
  if (!history.exists) {
    const scene_status began =
        beginning.findNear(Beginning::Begin::kWritten, state.is_acceleration_given, may_move);
    beginEnergy();
    return began;
  }
  if (!program.past().restore(history.past)) return SCENE_BAD_ARGUMENT;
  const scene_status began = program.begin(Beginning::Begin::kSaved);
  forgetSample();
  energy.resume(history.energy, time);
  return began;
}

std::string Motion::setState(const MotionState& state, bool project) {
  MotionState before;
  if (!saveState(&before)) return "the motion has stopped";
  MotionState taken = state;
  // A saved state that is consistent goes on to the bit; any other one is settled.
  if (state.history.exists && !isConsistent(state)) {
    taken.history = {};
    taken.is_acceleration_given = true;
  }
  const scene_status began = goOnFrom(taken, project);
  if (began == SCENE_OK && status.ok()) return "";
  std::string fault = beginning.describeFault(began);
  goOnFrom(before, false);
  return fault;
}

bool Motion::isConsistent(const MotionState& state) {
  // A state of a motion may lie on an event, the side of which a moment later is its own.
  constexpr double kMoment = 1e-9;  // s
  if (hasMoreThanLaws(scene)) return true;
  MotionState tried = state;
  tried.history = {};
  tried.is_acceleration_given = true;
  const auto goesOn = [&] { return goOnFrom(tried, false) == SCENE_OK && status.ok(); };
  if (goesOn()) return true;
  tried.time += kMoment;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    tried.angle[i] += kMoment * state.velocity[i];
    tried.velocity[i] += kMoment * state.acceleration[i];
  }
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (tried.signal[i].segmentEnd() <= kMoment) tried.signal[i].finishSegment();
    tried.signal[i].moveOrigin(kMoment);
  }
  return goesOn();
}

}  // namespace variator_sim
