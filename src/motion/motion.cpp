#include "motion/motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "motion/stop_message.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

Motion::Motion(Scene its_scene, const Shortcuts& shortcuts, const Motion* like)
    : scene(std::move(its_scene)),
      system(scene, shortcuts, like != nullptr ? &like->system : nullptr),
      drivetrain(system.drivetrain()),
      integrator(system, scene),
      energy_meter(integrator, system),
      commands(scene.inputs),
      quantities(scene),
      start_(system),
      first_(system.size()) {
  // Before the start: the search for it uses the machine code, too.
  if (like != nullptr) shareMachineCode(*like);
  reset();
  if (start_.result == InitialResult::kInconsistent || start_.result == InitialResult::kNotFound ||
      start_.result == InitialResult::kNotUnique || start_.result == InitialResult::kDoubtful) {
    throwInitialError(system, scene, start_);
  }
}

bool Motion::shareMachineCode(const Motion& other) {
  if (has_machine_code || scene.solver.machine_code == MachineCode::kNever) return has_machine_code;
  has_machine_code = drivetrain.shareMachineCode(series(), other.drivetrain) &&
                     integrator.shareMachineCode(other.integrator);
  if (has_machine_code) machine_code = "machine code, of another run";
  return has_machine_code;
}

// --- start -----------------------------------------------------------------------------------

void Motion::reset() {
  time = 0.0;
  forgetSample();
  commands.reset();
  drivetrain.resetInputs();
  integrator.reset();
  if (knows_first_) {
    // The accelerations of least reaction are the same every time; commands come later.
    start_.result = InitialResult::kConsistent;
    integrator.beginAt(first_);
    energy_meter.begin();
    return;
  }
  start();
  // (If accelerations are no part of the state, a start also leaves guesses of them.)
  knows_first_ =
      system.integratesTorque() && start_.result == InitialResult::kConsistent && status().ok();
  first_ = integrator.stepEnd().x;
}

void Motion::start() {
  forgetSample();
  start_.x.fill(0.0);
  start_.result = system.start(start_.x, start_.nearest, &start_.velocities_at_fault);
  if (start_.result == InitialResult::kConsistent) {
    integrator.beginFirstAt(start_.x);
  } else {
    integrator.beginNowhere(start_.x, diagnoseStart(system, start_));
  }
  energy_meter.begin();
}

// --- the current time ------------------------------------------------------------------------

const MotionStatus& Motion::advanceTo(double end) {
  if (!(end > time)) return status();
  if (end <= quiet_until_ && status().ok() && commands.isEmpty()) {
    time = end;
    is_sample_valid_ = false;
    return status();
  }
  try {
    return advance(end);
  } catch (...) {
    // Plugins do not throw; after one that does the motion can continue from its last step.
    integrator.stepBack();
    time = frontTime();
    integrator.restart();
    throw;
  }
}

const MotionStatus& Motion::advance(double end) {
  settle();
  integrator.leaveStart();
  // Timeouts of commands are events of the motion and act without a caller.
  for (double timeout = commands.nextTimeout(); status().ok() && timeout <= end;
       timeout = commands.nextTimeout()) {
    moveTo(std::max(timeout, time));      // a rounding may lie between them
    if (time < timeout) return status();  // interrupted
    if (status().ok()) {
      integrator.statistics().command_timeouts +=
          static_cast<std::uint64_t>(commands.addTimeouts(time, resolutionOf(time)));
    }
    if (timeout < end) settle();
  }
  moveTo(end);
  return status();
}

void Motion::moveTo(double end) {
  if (!status().ok()) return;
  const auto relative = [&] { return integrator.origin().relative(end); };
  bool goes_on = true;
  while (goes_on && integrator.stepEnd().time < relative()) {
    const bool is_wanted = !Interruption::isWanted();
    if (is_wanted && integrator.isSleeping() && relative() < integrator.sleepEnd()) break;
    goes_on = is_wanted && step(end);
  }
  time = goes_on ? end : (status().ok() ? quietUntil() : status().time);  // or interrupted
  forgetSample();
  // At a timeout its command acts.
  quiet_until_ = std::min(quietUntil(), std::nextafter(commands.nextTimeout(), -1.0));
}

bool Motion::step(double end) {
  bool goes_on = false;
  if (integrator.isSleeping()) {
    StepNode wake = integrator.stepEnd();
    wake.time = integrator.sleepEnd();
    integrator.calcRest(wake.time, wake.x);
    energy_meter.cut(wake);
    goes_on = integrator.finishSleep();
  } else {
    // Tracked energy is integrated inside of each step.
    goes_on = integrator.step(energy_meter.isTracked() ? time : end);
    energy_meter.notePassed();
  }
  if (!goes_on) return false;
  energy_meter.noteStep();
  return integrator.finishEnd();
}

double Motion::quietUntil() const {
  if (!status().ok() || !commands.isEmpty()) return time;
  const double front = integrator.stepEnd().time;
  double reached = frontTime();
  if (integrator.origin().relative(reached) > front) reached = std::nextafter(reached, 0.0);
  return std::max(time, std::min(reached, commands.nextTimeout()));
}

// --- commands --------------------------------------------------------------------------------

void Motion::settle() {
  if (commands.isEmpty() || !status().ok()) return;
  if (integrator.isStart()) {
    changeInitialInputs();
  } else if (isAnyCommandNew()) {  // otherwise the commands change nothing
    changeInputs();
  }
  commands.clear();
}

bool Motion::isAnyCommandNew() const {
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    if (commands.hasCommand(i) && drivetrain.signal(i).target() != commands.value(i)) return true;
  }
  return false;
}

bool Motion::cutStep(StepNode* node) {
  *node = integrator.stepEnd();
  if (!integrator.isSleeping() && !integrator.inside().contains(presentTime())) return true;
  if (!integrator.inside().reach(presentTime(), node)) {
    time = status().time;
    return false;
  }
  energy_meter.cut(*node);
  return true;
}

void Motion::changeInputs() {
  integrator.noteCommand(time);
  StepNode reached(system);
  if (!cutStep(&reached)) return;
  integrator.cutAt(time, reached);
  forgetSample();
  double u0[kMaxInputs];
  std::copy_n(drivetrain.inputs(), drivetrain.inputCount(), u0);
  drivetrain.saveSignals();
  bool jumps = false;
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    CommandSignal& signal = drivetrain.signal(i);
    if (!commands.hasCommand(i) || signal.target() == commands.value(i)) continue;
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    jumps = signal.command(input, 0.0, commands.value(i), resolutionOf(time)) || jumps;
  }
  if (jumps && !integrator.jump(u0)) {
    integrator.stepBack();  // the last accepted state: before these commands
    drivetrain.restoreSignals(0.0);
    return;
  }
  integrator.restart();
}

void Motion::changeInitialInputs() {
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    if (!commands.hasCommand(i)) continue;
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    drivetrain.signal(i).command(input, 0.0, commands.value(i));
  }
  drivetrain.refreshInputs(0.0);
  start();
}

// --- samples ---------------------------------------------------------------------------------

Sample& Motion::sample() {
  if (is_sample_valid_) return sample_;
  sampled_at_ = presentTime();
  if (!integrator.inside().calcSample(sampled_at_, &sample_)) takeSampleOfState();
  sample_.time = time;
  is_sample_valid_ = true;
  if (energy_meter.isTracked()) sample_.energy = energy_meter.calcEnergy(sample_, presentTime());
  return sample_;
}

void Motion::takeSampleOfState() {
  State x(system.size());
  if (!integrator.inside().calcState(&sampled_at_, x)) {
    time = status().time;
    sampled_at_ = presentTime();
  }
  system.calcSample(sampled_at_, x, &sample_);
  // A failed evaluation is repeated once; a value that does not exist ends the motion.
  if (!isSampleFinite()) system.calcSample(sampled_at_, x, &sample_);
  if (!isSampleFinite() && status().ok()) integrator.stopAtBadValue(time, sampled_at_, x);
}

bool Motion::isSampleFinite() const {
  double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
  for (int i = 0; i < system.shafts(); ++i) {
    poison += 0.0 * (sample_.angle[i] + sample_.velocity[i] + sample_.acceleration[i] +
                     sample_.applied_torque[i] + sample_.reaction_torque[i]);
  }
  return poison == 0.0;
}

StateView Motion::view() {
  const Sample& now = sample();
  return drivetrain.view(sampled_at_, now.angle, now.velocity, now.acceleration);
}

}  // namespace variator_sim
