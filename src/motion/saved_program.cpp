/// Saves the current state of a motion by the scene's program, and continues from a saved one.
#include <algorithm>
#include <string>

#include "motion/program_motion.h"

namespace variator_sim {

bool ProgramMotion::saveState(MotionState* state) {
  settle();
  if (!status_.ok() || !cut()) return false;
  const int S = scene.shaftCount();
  host_->leave(&it_);
  takeMemory();
  *state = MotionState{};
  state->time = time;
  std::copy_n(it_.state, S, state->angle);
  std::copy_n(it_.state + S, S, state->velocity);
  std::copy_n(it_.state + 2 * S, S, state->acceleration);
  writeInputs(state);
  state->history.exists = true;
  state->history.is_implicit = isImplicit();
  std::copy_n(it_.longest, scene.constraintCount(), state->history.longest_row);
  state->history.has_multipliers = true;
  std::copy_n(it_.multiplier, scene.constraintCount(), state->history.multiplier);
  saveHeld(state->history.held);
  std::copy_n(it_.armed, kMaxEvents, state->history.armed);
  state->history.past = past_.save();
  state->history.kept_reaction.exists = true;
  std::copy_n(it_.reaction, S, state->history.kept_reaction.value);
  state->history.energy = energy_.account();
  return goOnFrom(*state, false) == SCENE_OK;
}

scene_status ProgramMotion::goOnFrom(const MotionState& state, bool may_move) {
  const int S = scene.shaftCount();
  time = state.time;
  status_ = MotionStatus{};
  is_start_ = false;
  commands.reset();
  rhythm_.reset();
  progress_.begin(time);
  signal_origin_ = time;
  for (int i = 0; i < scene.inputCount(); ++i) {
    signal_[i] = state.signal[i];
    commands.setLastTime(i, state.last_command[i]);
  }
  std::copy_n(state.angle, S, it_.state);
  std::copy_n(state.velocity, S, it_.state + S);
  std::copy_n(state.acceleration, S, it_.state + 2 * S);
  std::copy_n(state.history.longest_row, scene.constraintCount(), it_.longest);
  std::copy_n(state.history.multiplier, scene.constraintCount(), it_.multiplier);
  restoreHeld(state.history.held);
  std::copy_n(state.history.kept_reaction.value, S, it_.reaction);
  std::copy_n(state.history.armed, kMaxEvents, it_.armed);
  it_.time = time;
  it_.time_rest = 0.0;
  it_.choice = {};
  if (state.history.is_implicit) {
    it_.choice.method = 1;
    it_.choice.left = kFewSteps;
  }
  if (state.history.exists && !past_.restore(state.history.past)) return SCENE_BAD_ARGUMENT;
  const scene_status status =
      state.history.exists ? begin(Begin::kSaved)
                           : beginNear(Begin::kWritten, state.is_acceleration_given, may_move);
  if (state.history.exists) {
    energy_.resume(state.history.energy, time);
  } else {
    energy_.begin(calcKineticEnergy());
    forgetSample();
  }
  return status;
}

std::string ProgramMotion::setState(const MotionState& state, bool project) {
  MotionState before;
  if (!saveState(&before)) return "the motion has stopped";
  MotionState taken = state;
  // A saved state that is consistent goes on to the bit; any other one is settled.
  if (state.history.exists && !isConsistent(state)) {
    taken.history = {};
    taken.is_acceleration_given = true;
  }
  const scene_status status = goOnFrom(taken, project);
  if (status == SCENE_OK && status_.ok()) return "";
  std::string fault = describeFault(status);
  goOnFrom(before, false);
  return fault;
}

std::string ProgramMotion::describeFault(scene_status status) {
  if (misfit_.kind == Misfit::Kind::kNone || misfit_.kind == Misfit::Kind::kModes) {
    return std::string("the motion cannot go on from there: ") + toString(reasonOf(status));
  }
  Sample unused;
  look(0.0, &unused, nullptr);  // what the laws read beside the state
  return describeMisfit(scene, misfit_, viewOf(misfit_.given, time));
}

void ProgramMotion::saveHeld(HeldState* held) const {
  for (int h = 0; h < program_->HOLDS; ++h) {
    const int row = program_->CONSTRAINTS + h;
    held[h] = {it_.hold[h].mode, it_.hold[h].counts,  it_.hold[h].side,
               it_.hold[h].heat, it_.multiplier[row], it_.longest[row]};
  }
}

void ProgramMotion::restoreHeld(const HeldState* held) {
  for (int h = 0; h < program_->HOLDS; ++h) {
    it_.hold[h] = {held[h].mode, held[h].counts, held[h].side, held[h].heat};
    it_.multiplier[program_->CONSTRAINTS + h] = held[h].multiplier;
    it_.longest[program_->CONSTRAINTS + h] = held[h].longest_row;
  }
}

}  // namespace variator_sim
