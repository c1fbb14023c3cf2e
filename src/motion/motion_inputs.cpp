#include "motion/motion_inputs.h"

#include <algorithm>

namespace variator_sim {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

MotionInputs::MotionInputs(const Scene& scene) : settings_(scene.inputs) {
  std::fill_n(first_clamped_, kMaxInputs, kNone);
}

void MotionInputs::reset(double time) {
  clear();
  std::fill_n(last_time_, kMaxInputs, kNever);
  rhythm_.reset();
  origin_ = time;
  for (int i = 0; i < count(); ++i) signal_[i].reset(settings(i));
}

void MotionInputs::save(double time, MotionState* state) const {
  std::copy_n(last_time_, count(), state->last_command);
  for (int i = 0; i < count(); ++i) {
    state->signal[i] = signal_[i];
    state->signal[i].moveOrigin(time - origin_);
  }
}

void MotionInputs::restore(const MotionState& state) {
  reset(state.time);
  std::copy_n(state.last_command, count(), last_time_);
  std::copy_n(state.signal, count(), signal_);
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

double MotionInputs::wait(int i, double value) {
  is_any_waiting_ = true;
  return waiting_[i] = std::min(settings(i).maximum, std::max(settings(i).minimum, value));
}

bool MotionInputs::command(int i, double value, double time) {
  last_time_[i] = time;
  if (wait(i, value) == value) return false;
  if (std::isnan(first_clamped_[i])) first_clamped_[i] = value;
  return true;
}

bool MotionInputs::isAnyNew() const {
  for (int i = 0; i < count(); ++i) {
    if (isWaiting(i) && signal_[i].target() != waiting_[i]) return true;
  }
  return false;
}

void MotionInputs::clear() {
  is_any_waiting_ = false;
  std::fill_n(waiting_, kMaxInputs, kNone);
}

double MotionInputs::timeoutOf(int i) const {
  return settings(i).timeout > 0.0 ? last_time_[i] + settings(i).timeout : kNever;
}

double MotionInputs::nextTimeout() const {
  double next = kNever;
  for (int i = 0; i < count(); ++i) next = std::min(next, timeoutOf(i));
  return next;
}

int MotionInputs::addTimeouts(double time) {
  int added = 0;
  for (int i = 0; i < count(); ++i) {
    // (Two that are meant for one instant may lie a rounding apart.)
    if (timeoutOf(i) > time + resolutionOf(time)) continue;
    last_time_[i] = kNever;
    ++added;
    if (settings(i).on_timeout == OnTimeout::kZero) wait(i, 0.0);
  }
  return added;
}

void MotionInputs::begin() {
  for (int i = 0; i < count(); ++i) {
    if (isWaiting(i)) signal_[i].command(settings(i), 0.0, waiting_[i]);
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
    if (!isWaiting(i) || signal.target() == waiting_[i]) continue;
    jumps = signal.command(settings(i), 0.0, waiting_[i], resolutionOf(time)) || jumps;
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
