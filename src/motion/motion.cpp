#include "motion/motion.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>
#include <utility>

#include "variator_sim/interruption.h"

namespace variator_sim {

Motion::Motion(Scene scene, const Shortcuts& shortcuts, const Motion* like)
    : scene_(std::move(scene)),
      own_system_(makeSystem(scene_, shortcuts, like != nullptr ? &like->system_ : nullptr)),
      system_(*own_system_),
      drivetrain_(system_.drivetrain()),
      integrator_(system_, scene_),
      energy_(system_, scene_,
              {scene_.solver.absolute_tolerance, scene_.solver.relative_tolerance}),
      commands_(scene_.inputs),
      quantities_(scene_),
      start_(system_),
      first_(system_.size()) {
  // Before the start, which is searched for with it.
  if (like != nullptr) shareMachineCode(*like);
  reset();
  if (start_.result == InitialResult::kInconsistent || start_.result == InitialResult::kNotFound ||
      start_.result == InitialResult::kNotUnique || start_.result == InitialResult::kDoubtful) {
    throwInitialError(system_, scene_, start_);
  }
}

std::vector<std::string> Motion::skips() const {
  std::vector<std::string> skips;
  if (!system_.readsAngles()) skips.emplace_back("derivatives by the angles (nothing reads them)");
  if (drivetrain_.hasConstantRows() && drivetrain_.constraintCount() > 0) {
    skips.emplace_back("factorizations but the first (C and J are constant)");
  }
  if (drivetrain_.inertia().isConstant()) {
    skips.emplace_back("inertial torques and connection (J is constant)");
  }
  if (!system_.integratesTorque()) {
    skips.emplace_back(
        "torque rates in the stages and stepped accelerations (the principle gives them)");
  }
  if (!drivetrain_.readsTime()) {
    skips.emplace_back(scene_.solver.sleep ? "anything at rest until a command (no explicit time)"
                                           : "derivatives by time (no explicit time)");
  }
  if (system_.isSpecialized()) {
    skips.emplace_back("loops over shafts and constraints (two and one)");
  }
  return skips;
}

const Statistics& Motion::statistics() {
  Statistics& statistics = integrator_.statistics();
  statistics.right_hand_sides = drivetrain_.rightHandSides();
  statistics.newton_iterations = drivetrain_.newtonIterations();
  statistics.stepper_switches = integrator_.choice().switches();
  return statistics;
}

bool Motion::loadMachineCode(bool compile, bool patiently) {
  if (has_machine_code_) return true;
  if (scene_.solver.machine_code == MachineCode::kNever) {
    machine_code_ = "the interpreter: 'solver/machine_code' is 'never'";
    return false;
  }
  const KernelLibrary::Missing missing = missingCode(compile, patiently);
  const auto begin = std::chrono::steady_clock::now();
  bool compiled = false;
  const std::string reason = drivetrain_.loadMachineCode(system_.series(), missing, &compiled);
  has_machine_code_ = reason.empty();
  if (!has_machine_code_) {
    machine_code_ = "the interpreter: " + reason;
  } else if (compiled) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    std::ostringstream text;
    text.precision(2);
    text << "machine code, compiled in " << seconds.count() << " s";
    machine_code_ = text.str();
  } else {
    machine_code_ = "machine code, from the cache";
  }
  return has_machine_code_;
}

bool Motion::shareMachineCode(const Motion& other) {
  if (has_machine_code_ || scene_.solver.machine_code == MachineCode::kNever) {
    return has_machine_code_;
  }
  has_machine_code_ = drivetrain_.shareMachineCode(system_.series(), other.drivetrain_);
  if (has_machine_code_) machine_code_ = "machine code, of another run";
  return has_machine_code_;
}

std::shared_ptr<SeriesLanes> Motion::loadLanes(bool compile) {
  if (!has_machine_code_ || system_.series() == nullptr) return nullptr;
  return drivetrain_.loadLanes(*system_.series(), missingCode(compile));
}

void Motion::calcConstraintRow(int m, double* C) {
  const StepNode& front = integrator_.front();
  double c0;
  drivetrain_.constraint(m).calcRow(system_.view(front.time, front.x), C, &c0);
}

// --- start -----------------------------------------------------------------------------------

void Motion::reset() {
  time_ = 0.0;
  forgetSample();
  commands_.reset();
  drivetrain_.resetInputs();
  integrator_.reset();
  if (knows_first_) {
    // The accelerations of least reaction are the same every time; commands come later.
    start_.result = InitialResult::kConsistent;
    integrator_.beginAt(first_);
    return;
  }
  start();
  // (Where accelerations are no part of the state, a start also leaves guesses of them.)
  knows_first_ =
      system_.integratesTorque() && start_.result == InitialResult::kConsistent && status().ok();
  first_ = integrator_.front().x;
}

void Motion::start() {
  forgetSample();
  start_.x.fill(0.0);
  start_.result = system_.start(start_.x, start_.nearest, &start_.velocities_at_fault);
  if (start_.result == InitialResult::kConsistent) {
    integrator_.beginFirstAt(start_.x);
  } else {
    integrator_.beginNowhere(start_.x, diagnoseStart(system_, start_));
  }
}

// --- the present -----------------------------------------------------------------------------

bool Motion::isInsideStep() const {
  const double front = integrator_.front().time;
  return integrator_.base().time < front && presentTime() != front;
}

const MotionStatus& Motion::advanceTo(double time) {
  if (!(time > time_)) return status();
  if (time <= quiet_until_ && status().ok() && commands_.isEmpty()) {
    time_ = time;
    sample_valid_ = false;
    return status();
  }
  try {
    return advance(time);
  } catch (...) {
    // Plugins do not throw; one that does leaves a motion that can go on from its last step.
    integrator_.stepBack();
    time_ = integrator_.origin().absolute(integrator_.front().time);
    integrator_.restart();
    throw;
  }
}

const MotionStatus& Motion::advance(double time) {
  carryOutCommands();
  if (integrator_.isStart()) energy_.begin(integrator_.front(), integrator_.rows());
  integrator_.leaveStart();
  // Commands that fail to come in time act on their own; they are events of the motion.
  for (double timeout = commands_.nextTimeout(); status().ok() && timeout <= time;
       timeout = commands_.nextTimeout()) {
    moveTo(std::max(timeout, time_));      // a rounding may lie between them
    if (time_ < timeout) return status();  // interrupted
    if (status().ok()) {
      integrator_.statistics().command_timeouts +=
          static_cast<std::uint64_t>(commands_.addTimeouts(time_, resolutionOf(time_)));
    }
    if (timeout < time) carryOutCommands();
  }
  moveTo(time);
  return status();
}

void Motion::moveTo(double time) {
  if (!status().ok()) return;
  const auto relative = [&] { return integrator_.origin().relative(time); };
  bool goes_on = true;
  while (goes_on && integrator_.front().time < relative()) {
    if (Interruption::isWanted()) {
      goes_on = false;
      break;
    }
    if (integrator_.isSleeping()) {
      if (relative() < integrator_.sleepEnd()) break;
      StepNode end = integrator_.front();
      end.time = integrator_.sleepEnd();
      integrator_.calcRest(end.time, end.x);
      cutEnergy(end);
      goes_on = integrator_.finishSleep();
    } else {
      // Who integrates inside of a step looks into each.
      goes_on = integrator_.step(energy_.isTracked() ? time_ : time);
      const Integrator::PassedSteps& passed = integrator_.passed();
      if (passed.begin != passed.end) energy_.notePassed(passed.from, passed.begin, passed.end);
    }
    if (goes_on) {
      energy_.noteStep(integrator_.base(), integrator_.front(), integrator_.rows(),
                       [this](double theta, State& x) { integrator_.calcInside(theta, x); });
      goes_on = integrator_.finishEnd();
    }
  }
  time_ = goes_on ? time : (status().ok() ? quietUntil() : status().time);  // or interrupted
  forgetSample();
  // At a timeout its command acts.
  quiet_until_ = std::min(quietUntil(), std::nextafter(commands_.nextTimeout(), -1.0));
}

double Motion::quietUntil() const {
  if (!status().ok() || !commands_.isEmpty()) return time_;
  const TimeOrigin& origin = integrator_.origin();
  const double front = integrator_.front().time;
  double reached = origin.absolute(front);
  if (origin.relative(reached) > front) reached = std::nextafter(reached, 0.0);
  return std::max(time_, std::min(reached, commands_.nextTimeout()));
}

// --- commands --------------------------------------------------------------------------------

CommandResult Motion::command(int input, double value) {
  Statistics& statistics = integrator_.statistics();
  if (!std::isfinite(value)) {
    ++statistics.commands_refused;
    return CommandResult::kRefused;
  }
  const bool is_clamped = commands_.add(input, value, time_);
  forgetSample();
  ++statistics.commands_accepted;
  if (!is_clamped) return CommandResult::kAccepted;
  ++statistics.commands_clamped;
  return CommandResult::kClamped;
}

bool Motion::isAnyCommandNew() const {
  for (int n = 0; n < commands_.count(); ++n) {
    if (drivetrain_.signal(commands_[n].input).target() != commands_[n].value) return true;
  }
  return false;
}

void Motion::carryOutCommands() {
  if (commands_.isEmpty() || !status().ok()) return;
  if (integrator_.isStart()) {
    carryOutInitialCommands();
    return;
  }
  if (isAnyCommandNew()) changeInputs(commands_);  // else as if nothing had come
  commands_.clear();
}

void Motion::changeInputs(const CommandQueue& queue) {
  integrator_.noteCommand(time_);

  StepNode reached = integrator_.front();
  if (integrator_.isSleeping() || isInsideStep()) {
    if (!integrator_.reach(presentTime(), &reached)) {
      time_ = status().time;
      return;
    }
    cutEnergy(reached);
  }
  integrator_.cutAt(time_, reached);
  forgetSample();
  double u0[kMaxInputs];
  std::copy_n(drivetrain_.inputs(), drivetrain_.inputCount(), u0);
  drivetrain_.saveSignals();
  bool jumps = false;
  for (int n = 0; n < queue.count(); ++n) {
    const int input = queue[n].input;
    CommandSignal& signal = drivetrain_.signal(input);
    if (signal.target() == queue[n].value) continue;
    jumps = signal.command(scene_.inputs[static_cast<std::size_t>(input)], 0.0, queue[n].value,
                           resolutionOf(time_)) ||
            jumps;
  }
  if (jumps && !integrator_.jump(u0)) {
    integrator_.stepBack();  // the last good state: before these commands
    drivetrain_.restoreSignals(0.0);
    return;
  }
  integrator_.restart();
}

void Motion::carryOutInitialCommands() {
  for (int n = 0; n < commands_.count(); ++n) {
    const int input = commands_[n].input;
    drivetrain_.signal(input).command(scene_.inputs[static_cast<std::size_t>(input)], 0.0,
                                      commands_[n].value);
  }
  commands_.clear();
  drivetrain_.refreshInputs(0.0);
  start();
}

// --- samples ---------------------------------------------------------------------------------

const Sample& Motion::sample() {
  if (status().ok()) carryOutCommands();
  if (!sample_valid_) takeSample();
  return sample_;
}

void Motion::takeSample() {
  sampled_at_ = presentTime();
  if (!integrator_.calcSample(sampled_at_, &sample_)) takeSampleOfState();
  sample_.time = time_;
  sample_valid_ = true;
  if (energy_.isTracked()) sample_.energy = energy_.calcEnergy(sample_, calcApplied());
}

void Motion::takeSampleOfState() {
  State x(system_.size());
  if (!integrator_.calcState(&sampled_at_, x)) {
    time_ = status().time;
    sampled_at_ = presentTime();
  }
  system_.calcSample(sampled_at_, x, &sample_);
  // A law that fails once is asked again; a value that does not exist ends the motion.
  if (!isSampleFinite()) system_.calcSample(sampled_at_, x, &sample_);
  if (!isSampleFinite() && status().ok()) integrator_.stopAtBadValue(time_, sampled_at_, x);
}

bool Motion::isSampleFinite() const {
  double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
  for (int i = 0; i < system_.shafts(); ++i) {
    poison += 0.0 * (sample_.angle[i] + sample_.velocity[i] + sample_.acceleration[i] +
                     sample_.applied_torque[i] + sample_.reaction_torque[i]);
  }
  return poison == 0.0;
}

void Motion::calcQuantities(QuantityGroup group, double* values) {
  quantities_.calc(group, present(), values);
}

StateView Motion::present() {
  const Sample& now = sample();
  return drivetrain_.view(sampled_at_, now.angle, now.velocity, now.acceleration);
}

OperatingPoint Motion::operatingPoint() {
  const StateView state = present();
  const int s = system_.shafts();
  const int inputs = drivetrain_.inputCount();
  OperatingPoint point;
  point.time = time_;
  point.angle.assign(state.angle, state.angle + s);
  point.velocity.assign(state.velocity, state.velocity + s);
  point.acceleration.assign(state.acceleration, state.acceleration + s);
  point.input.assign(state.input, state.input + inputs);
  point.input_rate.assign(state.input_rate, state.input_rate + inputs);
  for (int i = 0; i < inputs; ++i) point.command.push_back(drivetrain_.signal(i).target());
  return point;
}

// --- energy ----------------------------------------------------------------------------------

void Motion::trackEnergy(bool on) {
  if (on == energy_.isTracked()) return;
  energy_.track(on);
  forgetSample();
}

Energy Motion::energy() {
  const Sample& now = sample();
  return energy_.isTracked() ? now.energy : energy_.calcEnergy(now, calcApplied());
}

EnergyDoubt Motion::energyDoubt() const {
  return integrator_.isStart() ? EnergyDoubt{} : energy_.doubt(time_);
}

void Motion::cutEnergy(const StepNode& node) {
  if (integrator_.isSleeping()) {
    energy_.cutAtRest(integrator_.front(), node);
  } else {
    energy_.cut(integrator_.base(), integrator_.front(), node,
                [this](double theta, State& x) { integrator_.calcInside(theta, x); });
  }
}

double Motion::calcApplied() {
  const StepNode& base = integrator_.base();
  const StepNode& front = integrator_.front();
  if (integrator_.isStart()) energy_.begin(front, integrator_.rows());
  if (integrator_.isSleeping()) {
    State x(system_.size());
    integrator_.calcRest(presentTime(), x);
    return energy_.calcAppliedAtRest(front, x);
  }
  if (!isInsideStep()) return energy_.applied();
  const double part = (presentTime() - base.time) / (front.time - base.time);
  return energy_.calcApplied(base, front, part,
                             [this](double theta, State& x) { integrator_.calcInside(theta, x); });
}

}  // namespace variator_sim
