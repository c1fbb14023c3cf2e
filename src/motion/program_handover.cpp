/// How the integrator takes over from the scene's program, and gives the motion back.
#include <algorithm>
#include <cmath>
#include <limits>

#include "motion/program_motion.h"

namespace variator_sim {

bool ProgramMotion::stepIntegrated(double end) {
  steps_left_ = std::max(0, steps_left_ - 1);
  const double before = frontTime();
  const bool is_good = integrated().step(end);
  forgetSample();
  // (A step that time does not resolve is a short one, too.)
  const double made = std::max(frontTime() - before, std::numeric_limits<double>::min());
  // An input that moves ever so fast has its reason for short steps.
  const double left = motion_->drivetrain.inputSegmentEnd() - motion_->integrator.stepEnd().time;
  const bool may_be_short = motion_->isSleeping() || left < 1e3 * Progress::leastAt(before);
  if (!is_good || may_be_short || !progress_.isStuck(before, made)) return is_good;
  motion_->integrator.stopStuck();
  return false;
}

void ProgramMotion::commandIntegrated() {
  Motion& motion = integrated();
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (commands.hasCommand(i)) motion.commands.add(i, commands.value(i), time);
  }
  motion.forgetSample();
  motion.settle();
  time = motion.time;
  forgetSample();
}

bool ProgramMotion::mayTakeOver() {
  Integrator& integrator = motion_->integrator;
  if (steps_left_ > 0 || !integrator.mayStepBySeries()) return false;
  // A controller's machine is to be seen at rest at once.
  return integrator.stepStart().time < integrator.stepEnd().time || !integrator.sleepExactly();
}

void ProgramMotion::describeIntegrated() {
  Integrator& integrator = motion_->integrator;
  const double end = integrator.stepEnd().time;
  std::fill_n(multiplier_, kMaxConstraints, 0.0);
  integrator.describeEnd(state_, multiplier_, longest_);
  std::copy_n(motion_->system.reaction().kept().value, scene.shaftCount(), reaction_);
  signal_origin_ = integrator.origin();
  signal_origin_.moveBy(end);
  for (int i = 0; i < scene.inputCount(); ++i) {
    signal_[i] = motion_->signal(i);
    signal_[i].moveOrigin(end);
  }
  it_.time = signal_origin_.time();
  it_.time_rest = signal_origin_.rest();
  it_.usual = kFirstUnit;
  it_.choice = {};
  const Stepper& stepper = integrator.choice().stepper();
  if (stepper.isImplicit()) it_.choice.method = 1;
  it_.choice.left = kFewSteps;
  describeInputs();
}

void ProgramMotion::takeOver() {
  describeIntegrated();
  begin(Begin::kSaved);
  noteRounding();
  const EnergyAccount& account = motion_->energy_meter.account();
  start_kinetic_ = account.start_kinetic;
  applied_ = applied_before_ = account.applied;
  is_integrated_ = false;
  settling_ = 0;
}

void ProgramMotion::handOver(int steps) {
  host_->leave(&it_);
  TimeOrigin front;
  front.moveTo(it_.time);
  front.moveBy(it_.time_rest);
  const double now = signal_origin_.relative(it_.time) + it_.time_rest;
  for (int i = 0; i < scene.inputCount(); ++i) {
    CommandSignal& signal = motion_->drivetrain.signal(i);
    signal = signal_[i];
    if (signal.segmentEnd() <= now) signal.finishSegment();
    signal.moveOrigin(now);
  }
  State x(motion_->system.size());
  std::copy_n(state_, x.size(), x.begin());
  motion_->integrator.goOnFrom(front, x, state_ + 2 * scene.shaftCount(), longest_);
  motion_->forgetSample();
  is_integrated_ = true;
  has_step_ = false;
  steps_left_ = steps;
}

void ProgramMotion::handOverPatiently() {
  handOver(patience_);
  patience_ = std::min(2 * patience_, kMostPatience);
}

void ProgramMotion::noteRounding() {
  if (motion_ == nullptr) return;
  State x(motion_->system.size());
  std::copy_n(state_, x.size(), x.begin());
  motion_->integrator.noteRounding(it_.time, x);
}

bool ProgramMotion::reconsider() {
  if (!scene.solver.sleep) return false;
  const Tolerance tolerance{scene.solver.absolute_tolerance, scene.solver.relative_tolerance};
  const bool is_driven = motion_->drivetrain.readsTime();
  double change = 0.0;
  for (int n = motion_->system.readsAngles() ? 0 : scene.shaftCount(); n < motion_->system.size();
       ++n) {
    change = std::max(change, std::abs(state_[n] - before_[n]) / tolerance.of(state_[n]));
  }
  settling_ = change <= (is_driven ? kNearStandstill : kNearRest) ? settling_ + 1 : 0;
  if (settling_ < kSettling && (change != 0.0 || is_driven)) return false;
  handOverPatiently();
  if (change != 0.0) motion_->integrator.settle(it_.usual);
  return true;
}

void ProgramMotion::noteEnergy() {
  const int S = scene.shaftCount();
  const double work = host_->calcWork(it_.made, &through_);
  applied_ += work;
  if (motion_ == nullptr) return;
  if (motion_->energy_meter.isWatched()) {
    host_->look(entries_.data());
    for (int m = 0; m < scene.constraintCount(); ++m) {
      std::copy_n(entries_.data() + S * m, S, rows_[m]);
    }
  }
  motion_->energy_meter.noteStepElsewhere(frontTime(), work, through_, state_, rows_.get());
}

void ProgramMotion::cutEnergy(double at) {
  double through = 0.0;
  applied_ = applied_before_ + host_->calcWork(at, &through);
  if (motion_ != nullptr) motion_->energy_meter.cutElsewhere(time, applied_, through_ - through);
}

void ProgramMotion::recover() {
  if (!is_integrated_) return;
  motion_->recover();
  time = motion_->time;
}

void ProgramMotion::exhaustTime() {
  if (motion_ == nullptr) {
    stop(StopReason::kTimeExhausted);
    return;
  }
  if (!is_integrated_ && cut()) handOver(0);
  integrated().exhaustTime();
}

void ProgramMotion::trackEnergy(bool on) {
  is_energy_tracked_ = on;
  if (motion_ != nullptr) motion_->trackEnergy(on);
}

}  // namespace variator_sim
