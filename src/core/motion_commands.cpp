#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "motion.h"

namespace variator_sim {

CommandResult Motion::command(int input, double value) {
  const CommandInputSettings& settings = scene_.inputs[input];
  if (!std::isfinite(value)) {
    ++statistics_.commands_refused;
    return CommandResult::kRefused;
  }
  const double clamped = std::min(settings.maximum, std::max(settings.minimum, value));
  stage(input, clamped);
  last_command_time_[input] = time_;
  ++statistics_.commands_accepted;
  if (clamped == value) return CommandResult::kAccepted;
  ++statistics_.commands_clamped;
  return CommandResult::kClamped;
}

void Motion::stage(int input, double value) {
  sample_valid_ = false;
  for (int p = 0; p < pending_count_; ++p) {
    if (pending_[p].input != input) continue;
    pending_[p].value = value;
    return;
  }
  pending_[pending_count_++] = {input, value};
}

double Motion::nextTimeout() const {
  double next = kNever;
  for (int i = 0; i < drivetrain_.inputCount(); ++i) {
    const double timeout = scene_.inputs[i].timeout;
    if (timeout > 0.0 && last_command_time_[i] != kNever) {
      next = std::min(next, last_command_time_[i] + timeout);
    }
  }
  return next;
}

void Motion::applyTimeouts() {
  for (int i = 0; i < drivetrain_.inputCount(); ++i) {
    const CommandInputSettings& settings = scene_.inputs[i];
    if (settings.timeout <= 0.0 || last_command_time_[i] == kNever) continue;
    // (Two that are meant for one instant may be a rounding apart.)
    if (last_command_time_[i] + settings.timeout > time_ + shortestStep(time_)) continue;
    last_command_time_[i] = kNever;
    ++statistics_.command_timeouts;
    if (settings.on_timeout == OnTimeout::kZero) {
      stage(i, std::min(settings.maximum, std::max(settings.minimum, 0.0)));
    }
  }
}

void Motion::applyPending() {
  if (pending_count_ == 0 || !status_.ok()) return;
  const int count = std::exchange(pending_count_, 0);
  if (!advanced_) {
    applyInitialCommands(count);
    return;
  }
  bool changed = false;
  for (int p = 0; p < count; ++p) {
    changed = changed || drivetrain_.signal(pending_[p].input).target() != pending_[p].value;
  }
  if (!changed) return;  // the motion goes on as if nothing had come
  rhythm_.note(time_);

  StepNode reached = front_;
  if (sleeping_ || isInsideStep()) {
    if (!reachPresent(&reached)) return;
    cutEnergy(reached);
  }
  front_ = reached;
  moveOriginToPresent();
  front_.time = 0.0;
  drivetrain_.refreshInputs(front_.time);
  base_ = front_;
  sample_valid_ = false;
  double u0[kMaxInputs];
  copyInputs(u0);
  drivetrain_.saveSignals();
  bool jumps = false;
  for (int p = 0; p < count; ++p) {
    const int input = pending_[p].input;
    CommandSignal& signal = drivetrain_.signal(input);
    if (signal.target() == pending_[p].value) continue;
    jumps =
        signal.command(scene_.inputs[input], front_.time, pending_[p].value, shortestStep(time_)) ||
        jumps;
  }
  if (jumps && !jump(u0)) {
    front_ = base_;  // the last good state: before these commands
    drivetrain_.restoreSignals(front_.time);
    return;
  }
  restart();
}

bool Motion::haveInputsJumped(const double* u0) const {
  constexpr double kRounding = 1e-14;
  for (int i = 0; i < drivetrain_.inputCount(); ++i) {
    const double u1 = drivetrain_.inputs()[i];
    if (std::abs(u1 - u0[i]) > kRounding * (std::abs(u1) + std::abs(u0[i]))) return true;
  }
  return false;
}

bool Motion::jump(const double* u0) {
  ++statistics_.jumps;
  drivetrain_.refreshInputs(front_.time);
  double u1[kMaxInputs];
  copyInputs(u1);
  const MotionStatus result = system_.jump(front_.time, front_.x, u0, u1, &statistics_.projections);
  if (result.ok()) return true;
  status_ = result;
  status_.time = absolute(front_.time);
  return false;
}

void Motion::applyInitialCommands(int count) {
  for (int p = 0; p < count; ++p) {
    const int input = pending_[p].input;
    drivetrain_.signal(input).command(scene_.inputs[input], 0.0, pending_[p].value);
  }
  drivetrain_.refreshInputs(0.0);
  start();
}

}  // namespace variator_sim
