#include "motion/motion_base.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "motion/time_resolution.h"
#include "variator_sim/interruption.h"
#include "variator_sim/operating_point.h"

namespace variator_sim {

MotionBase::MotionBase(Scene its_scene)
    : scene(std::move(its_scene)), commands(scene.inputs), quantities(scene) {}

// --- the current time ------------------------------------------------------------------------

const MotionStatus& MotionBase::advanceTo(double end) {
  if (!(end > time)) return status();
  if (end <= quiet_until_ && status().ok() && commands.isEmpty()) {
    time = end;
    is_sample_valid_ = false;
    return status();
  }
  settle();
  leaveStart();
  // Timeouts of commands are events of the motion and act without a caller.
  for (double timeout = commands.nextTimeout(); status().ok() && timeout <= end;
       timeout = commands.nextTimeout()) {
    moveTo(std::max(timeout, time));      // a rounding may lie between them
    if (time < timeout) return status();  // interrupted
    if (status().ok()) {
      statistics().command_timeouts +=
          static_cast<std::uint64_t>(commands.addTimeouts(time, resolutionOf(time)));
    }
    if (timeout < end) settle();
  }
  moveTo(end);
  return status();
}

void MotionBase::moveTo(double end) {
  if (!status().ok()) return;
  bool goes_on = true;
  while (goes_on && !isMadeUpTo(end)) goes_on = !Interruption::isWanted() && step(end);
  time = goes_on ? end : (status().ok() ? quietUntil() : status().time);  // or interrupted
  forgetSample();
  // At a timeout its command acts.
  quiet_until_ = std::min(quietUntil(), std::nextafter(commands.nextTimeout(), -1.0));
}

double MotionBase::quietUntil() const {
  if (!status().ok() || !commands.isEmpty()) return time;
  return std::max(time, std::min(lastInside(), commands.nextTimeout()));
}

// --- commands --------------------------------------------------------------------------------

void MotionBase::settle() {
  if (commands.isEmpty() || !status().ok()) return;
  if (isStart()) {
    changeInitialInputs();
  } else if (isAnyCommandNew()) {  // otherwise the commands change nothing
    changeInputs();
  }
  commands.clear();
}

bool MotionBase::isAnyCommandNew() const {
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (commands.hasCommand(i) && signal(i).target() != commands.value(i)) return true;
  }
  return false;
}

bool MotionBase::useCodeOf(const MotionBase& other) {
  if (has_machine_code || scene.solver.machine_code == MachineCode::kNever) return has_machine_code;
  has_machine_code = shareMachineCode(other);
  if (has_machine_code) machine_code = "machine code, of another run";
  return has_machine_code;
}

// --- samples ---------------------------------------------------------------------------------

Sample& MotionBase::sample() {
  if (is_sample_valid_) return sample_;
  takeSample(&sample_);
  sample_.time = time;
  is_sample_valid_ = true;
  if (isEnergyTracked()) sample_.energy = calcEnergy();
  return sample_;
}

bool MotionBase::peekState(MotionState* state) {
  settle();
  const Sample& now = sample();
  if (!status().ok()) return false;
  *state = MotionState{};
  state->time = time;
  std::copy_n(now.angle, scene.shaftCount(), state->angle);
  std::copy_n(now.velocity, scene.shaftCount(), state->velocity);
  std::copy_n(now.acceleration, scene.shaftCount(), state->acceleration);
  writeInputs(state);
  return true;
}

void MotionBase::writeInputs(MotionState* state) const {
  for (int i = 0; i < scene.inputCount(); ++i) {
    state->signal[i] = signal(i);
    state->signal[i].moveOrigin(signalTime());
    state->last_command[i] = commands.lastTime(i);
  }
}

OperatingPoint MotionBase::operatingPoint() {
  settle();
  const StateView state = view();
  OperatingPoint point;
  point.time = time;
  point.angle.assign(state.angle, state.angle + scene.shaftCount());
  point.velocity.assign(state.velocity, state.velocity + scene.shaftCount());
  point.acceleration.assign(state.acceleration, state.acceleration + scene.shaftCount());
  point.input.assign(state.input, state.input + scene.inputCount());
  point.input_rate.assign(state.input_rate, state.input_rate + scene.inputCount());
  if (state.input_second_rate != nullptr) {
    point.input_second_rate.assign(state.input_second_rate,
                                   state.input_second_rate + scene.inputCount());
  }
  for (int i = 0; i < scene.inputCount(); ++i) point.command.push_back(signal(i).target());
  for (std::size_t h = 0; state.held != nullptr && h < scene.holdNames().size(); ++h) {
    point.mode.push_back(state.held[h].mode);
  }
  return point;
}

}  // namespace variator_sim
