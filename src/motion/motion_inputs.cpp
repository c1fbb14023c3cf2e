#include "motion/motion_inputs.h"

#include "motion/time_resolution.h"

namespace variator_sim {

void MotionInputs::reset(double time) {
  commands.reset();
  rhythm_.reset();
  origin_ = time;
  for (int i = 0; i < count(); ++i) signal_[i].reset(settings(i));
}

void MotionInputs::save(double time, MotionState* state) const {
  for (int i = 0; i < count(); ++i) {
    state->signal[i] = signal_[i];
    state->signal[i].moveOrigin(time - origin_);
    state->last_command[i] = commands.lastTime(i);
  }
}

void MotionInputs::restore(const MotionState& state) {
  reset(state.time);
  for (int i = 0; i < count(); ++i) {
    signal_[i] = state.signal[i];
    commands.setLastTime(i, state.last_command[i]);
  }
}

CommandSignal::Moment MotionInputs::at(int i, double time) const {
  CommandSignal signal = signal_[i];
  if (signal.segmentEnd() <= time - origin_) signal.finishSegment();
  return signal.at(time - origin_);
}

void MotionInputs::describe(vs_exchanged_signal* to) const {
  for (int i = 0; i < count(); ++i) {
    const CommandSignal::Closed from = signal_[i].closed();
    to[i] = {from.form,        from.start,  from.target, from.slope,
             from.inverse_tau, from.linear, from.age,    from.end};
  }
}

bool MotionInputs::isAnyNew() const {
  for (int i = 0; i < count(); ++i) {
    if (commands.hasCommand(i) && signal_[i].target() != commands.value(i)) return true;
  }
  return false;
}

void MotionInputs::begin() {
  for (int i = 0; i < count(); ++i) {
    if (commands.hasCommand(i)) signal_[i].command(settings(i), 0.0, commands.value(i));
  }
}

bool MotionInputs::change(double time) {
  rhythm_.note(time);
  const double now = time - origin_;
  origin_ = time;
  bool jumps = false;
  for (int i = 0; i < count(); ++i) {
    CommandSignal& signal = signal_[i];
    if (signal.segmentEnd() <= now) signal.finishSegment();
    signal.moveOrigin(now);
    if (!commands.hasCommand(i) || signal.target() == commands.value(i)) continue;
    jumps = signal.command(settings(i), 0.0, commands.value(i), resolutionOf(time)) || jumps;
  }
  return jumps;
}

void MotionInputs::takeMemory(double time, const vs_exchanged_signal* from) {
  for (int i = 0; i < count(); ++i) {
    if (settings(i).kind == InputKind::kCommanded) continue;
    signal_[i].command(settings(i), time - origin_, from[i].start);
  }
}

}  // namespace variator_sim
