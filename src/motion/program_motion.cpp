#include "motion/program_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "integrate/series_stiffness.h"
#include "variator_sim/errors.h"

namespace variator_sim {

namespace {

/// s: the length of a first step is found from a series in this unit.
constexpr double kFirstUnit = 1e-3;
/// s: the longest step, whose powers do not overflow.
constexpr double kLongestStep = 1e6;

StopReason reasonOf(scene_status status) {
  switch (status) {
    case SCENE_SINGULAR:
      return StopReason::kSingularConstraint;
    case SCENE_NOT_CONVERGED:
    case SCENE_INCONSISTENT:
      return StopReason::kProjectionFailed;
    case SCENE_NOT_FINITE:
    case SCENE_BAD_ARGUMENT:
      return StopReason::kNonFiniteValue;
    case SCENE_TOO_MANY_STEPS:
      return StopReason::kStepUnderflow;
    case SCENE_CHATTERING:
      return StopReason::kChattering;
    case SCENE_NO_MOTION:
      return StopReason::kJumpFailed;
    case SCENE_NO_MODES:
      return StopReason::kNoModes;
    case SCENE_OK:
      break;
  }
  return StopReason::kNone;
}

const char* explain(StopReason reason) {
  switch (reason) {
    case StopReason::kSingularConstraint:
      return "the derivatives of the constraints by the accelerations have lost rank, so the "
             "principle no longer determines the jerk";
    case StopReason::kStepUnderflow:
      return "the step fell below the resolution of time: the motion changes ever faster here, or "
             "has no power series";
    case StopReason::kNonFiniteValue:
      return "a value is NaN or infinite here or just ahead";
    case StopReason::kJumpFailed:
      return "the jump leads to no state on the constraints";
    case StopReason::kChattering:
      return "a law jumps, or bends, where the motion turns back at once, so none of its branches "
             "goes on";
    case StopReason::kTimeExhausted:
      return "simulated time has come to the end of what messages can hold, 136 years: ~reset_time "
             "begins it anew";
    case StopReason::kNoModes:
      return "no modes of the elements that hold go on: rigid ones contradict each other, or "
             "limits that depend on the motion leave none";
    case StopReason::kStepLimit:
      return "more steps than 'solver/maximum_steps' within one simulated second";
    default:
      return "no accelerations that satisfy the constraints were found";
  }
}

}  // namespace

ProgramMotion::ProgramMotion(Scene its_scene, std::unique_ptr<MotionProgram> program,
                             std::unique_ptr<Motion> integrator, const ProgramMotion* like)
    : MotionBase(std::move(its_scene)),
      motion_(std::move(integrator)),
      program_(std::move(program)),
      host_(hostMotion(*program_)),
      progress_(scene.solver.maximum_steps) {
  it_.state = state_;
  it_.multiplier = multiplier_;
  it_.reaction = reaction_;
  it_.longest = longest_;
  it_.input = input_;
  if (motion_ != nullptr) {
    motion_->is_beside_program = true;
    motion_->integrator.choice().letProgramStep();
  }
  it_.hold = hold_;
  if (program_->HOLDS > 0) events_.resize(kMostEvents);
  it_.armed = armed_;
  reset();
  if (like != nullptr) useCodeOf(*like);
}

// --- beginnings ------------------------------------------------------------------------------

void ProgramMotion::reset() {
  time = 0.0;
  forgetSample();
  commands.reset();
  rhythm_.reset();
  progress_.begin(0.0);
  patience_ = kFirstPatience;
  steps_left_ = 0;
  has_step_ = false;
  is_integrated_ = motion_ != nullptr;
  if (is_integrated_) {
    motion_->reset();
    return;
  }
  status_ = MotionStatus{};
  statistics_ = Statistics{};
  signal_origin_.moveTo(0.0);
  for (int i = 0; i < scene.inputCount(); ++i) {
    signal_[i].reset(scene.inputs[static_cast<std::size_t>(i)]);
  }
  is_start_ = true;
  first_event_ = event_count_ = last_events_ = 0;
  const scene_status status = start();
  if (status != SCENE_OK) throwInitialError(status);
}

scene_status ProgramMotion::start() {
  const int S = scene.shaftCount();
  std::fill_n(state_, 3 * S, 0.0);
  std::fill_n(multiplier_, kMostRows, 0.0);
  std::fill_n(reaction_, kMaxShafts, 0.0);
  std::fill_n(longest_, kMostRows, 0.0);
  std::copy(scene.initial.angle.begin(), scene.initial.angle.end(), state_);
  std::copy(scene.initial.velocity.begin(), scene.initial.velocity.end(), state_ + S);
  std::copy(scene.initial.acceleration.begin(), scene.initial.acceleration.end(), state_ + 2 * S);
  it_.are_given = scene.initial.acceleration.empty() ? 0 : 1;
  it_.may_move = scene.initial.project ? 1 : 0;
  it_.time = it_.time_rest = 0.0;
  const scene_status status = begin(Begin::kStart);
  start_kinetic_ = calcEnergy().kinetic;
  return status;
}

scene_status ProgramMotion::begin(Begin how) {
  it_.begin = static_cast<int>(how);
  it_.usual = kFirstUnit;
  describeInputs();
  const scene_status status = host_->begin(it_);
  begin_ = it_.time;
  begin_rest_ = it_.time_rest;
  has_step_ = is_still_ = false;
  made_since_ = 0;
  applied_ = applied_before_ = 0.0;
  forgetSample();
  return status;
}

void ProgramMotion::describeInputs() {
  for (int n = 0; n < scene.inputCount(); ++n) {
    const CommandSignal::Closed from = signal_[n].closed();
    input_[n] = {from.form,        from.start,  from.target, from.slope,
                 from.inverse_tau, from.linear, -from.since, from.end - from.since};
  }
}

void ProgramMotion::takeMemory() {
  for (int i = 0; i < scene.inputCount(); ++i) {
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    if (input.kind == InputKind::kCommanded) continue;
    signal_[i].command(input, signalTime(), input_[i].start);
  }
}

void ProgramMotion::beginAnew() {
  made_since_ = 0;
  host_->leave(&it_);
  if (next_host_ != nullptr) host_ = std::move(next_host_);
  it_.begin = static_cast<int>(Begin::kSaved);
  host_->begin(it_);
}

void ProgramMotion::leaveStart() {
  is_start_ = false;
  if (is_integrated_) motion_->leaveStart();
}

// --- the integrator --------------------------------------------------------------------------

bool ProgramMotion::stepIntegrated(double end) {
  steps_left_ = std::max(0, steps_left_ - 1);
  const double before = frontTime();
  const bool is_good = integrated().step(end);
  forgetSample();
  // (A step that time does not resolve is a short one, too.)
  const double made = std::max(frontTime() - before, std::numeric_limits<double>::min());
  if (!is_good || motion_->isSleeping() || !progress_.isStuck(before, made)) return is_good;
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
  describeInputs();
}

void ProgramMotion::takeOver() {
  describeIntegrated();
  std::copy_n(motion_->integrator.stepEnd().torque.data(), scene.shaftCount(), torque_);
  begin(Begin::kSaved);
  const EnergyAccount& account = motion_->energy_meter.account();
  start_kinetic_ = account.start_kinetic;
  applied_ = applied_before_ = account.applied;
  is_integrated_ = false;
  settling_ = 0;
}

void ProgramMotion::handOver(int steps, double trial) {
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
  motion_->integrator.goOnFrom(front, x, state_ + 2 * scene.shaftCount(), longest_, trial);
  motion_->forgetSample();
  is_integrated_ = true;
  has_step_ = false;
  steps_left_ = steps;
}

double ProgramMotion::calcStiffness() {
  const double* rows[3 * kMaxShafts];
  vs_shown shown = {rows, 0, 0.0};
  host_->show(&shown);
  const bool is_classical = scene.principle == Principle::kGauss;
  const int last = is_classical ? shown.last + 1 : shown.last;
  if (last < series_stiffness::kDerivatives) return 0.0;
  const int early = std::max(2, last / 4);
  double early_bound = 2.0 * series_stiffness::kFaint;
  for (int k = 1; k <= early; ++k) early_bound *= last / (series_stiffness::kE * k);
  const int first = motion_->system.readsAngles() ? 0 : scene.shaftCount();
  return series_stiffness::estimate(
      shown.rows, first, motion_->system.size(), last, it_.usual / shown.unit, early, early_bound,
      {scene.solver.absolute_tolerance, scene.solver.relative_tolerance});
}

bool ProgramMotion::reconsider() {
  const Tolerance tolerance{scene.solver.absolute_tolerance, scene.solver.relative_tolerance};
  const bool is_driven = motion_->drivetrain.readsTime();
  if (scene.solver.sleep) {
    double change = 0.0;
    for (int n = motion_->system.readsAngles() ? 0 : scene.shaftCount(); n < motion_->system.size();
         ++n) {
      change = std::max(change, std::abs(state_[n] - before_[n]) / tolerance.of(state_[n]));
    }
    settling_ = change <= (is_driven ? kNearStandstill : kNearRest) ? settling_ + 1 : 0;
    if (settling_ >= kSettling || (change == 0.0 && !is_driven)) {
      handOver(patience_);
      patience_ = std::min(2 * patience_, kMostPatience);
      return true;
    }
  }
  StepperChoice& choice = motion_->integrator.choice();
  if (!choice.isAutomatic() || !choice.suspect([this] { return calcStiffness(); })) return false;
  handOver(0, it_.usual);
  return true;
}

void ProgramMotion::noteEnergy() {
  const int S = scene.shaftCount();
  const double work = host_->calcWork(it_.made);
  applied_ += work;
  if (motion_ == nullptr) return;
  double torque[kMaxShafts] = {};
  double entry[kMaxConstraints * kMaxShafts] = {};
  double rows[kMaxConstraints][kMaxShafts] = {};
  through_ = 0.0;
  if (motion_->energy_meter.isWatched()) {
    host_->look(torque, entry);
    for (int m = 0; m < scene.constraintCount(); ++m) std::copy_n(entry + S * m, S, rows[m]);
    for (int i = 0; i < S; ++i) {
      through_ += 0.5 * it_.made *
                  (std::abs(torque_[i] * before_[S + i]) + std::abs(torque[i] * state_[S + i]));
      torque_[i] = torque[i];
    }
  }
  motion_->energy_meter.noteStepElsewhere(frontTime(), work, through_, state_, rows);
}

void ProgramMotion::cutEnergy(double at) {
  applied_ = applied_before_ + host_->calcWork(at);
  if (motion_ == nullptr) return;
  EnergyAccount account = motion_->energy_meter.account();
  account.applied = applied_;
  account.throughput -= (1.0 - std::min(1.0, at / it_.made)) * through_;
  motion_->energy_meter.resume(account, time);
}

// --- steps -----------------------------------------------------------------------------------

bool ProgramMotion::step(double end) {
  if (is_integrated_) {
    if (!mayTakeOver()) return motion_->isMadeUpTo(end) || stepIntegrated(end);
    takeOver();
  } else if (motion_ != nullptr && has_step_ && reconsider()) {
    return stepIntegrated(end);
  }
  if (!progress_.count(frontTime())) {
    if (motion_ != nullptr) {
      handOver(kMostPatience);
      return stepIntegrated(end);
    }
    stop(StopReason::kStepLimit);
    status_.time = frontTime();
    return false;
  }
  if (next_host_ != nullptr || made_since_ >= kMostBetween) beginAnew();
  const double expected = sinceFront(rhythm_.next());
  const double longest = std::min(scene.solver.maximum_step, kLongestStep);
  const double left =
      expected > 2.0 * resolutionOf(frontTime()) ? std::min(longest, expected) : longest;
  begin_ = it_.time;
  begin_rest_ = it_.time_rest;
  applied_before_ = applied_;
  std::copy_n(state_, 3 * scene.shaftCount(), before_);
  const scene_status status = host_->step(left, &it_);
  Statistics& counted = statistics();
  counted.rejected_steps += static_cast<std::uint64_t>(it_.rejections);
  has_step_ = status == SCENE_OK;
  forgetSample();
  if (!has_step_) {
    if (motion_ == nullptr) {
      stop(status);
      return false;
    }
    const bool has_no_series = status == SCENE_NOT_FINITE || status == SCENE_TOO_MANY_STEPS;
    handOver(has_no_series ? 0 : patience_);
    if (has_no_series) {
      motion_->integrator.giveUpSeries();
    } else {
      patience_ = std::min(2 * patience_, kMostPatience);
    }
    return stepIntegrated(end);
  }
  noteEvents();
  ++made_since_;
  ++counted.steps;
  if (it_.passed >= 0 || it_.is_event != 0) ++counted.kinks;
  if (motion_ == nullptr && it_.is_still != 0 && !is_still_) ++counted.sleeps;
  is_still_ = it_.is_still != 0;
  noteEnergy();
  if (motion_ != nullptr) motion_->drivetrain.countRightHandSide();
  return true;
}

double ProgramMotion::lastInside() const {
  if (is_integrated_) return motion_->lastInside();
  const double reached = frontTime();
  return sinceFront(reached) > 0.0 ? std::nextafter(reached, 0.0) : reached;
}

void ProgramMotion::stop(scene_status status) {
  stop(reasonOf(status));
  status_.time = frontTime();
}

// --- commands --------------------------------------------------------------------------------

bool ProgramMotion::cut() {
  if (!has_step_) return true;
  const double at = insideStep(time);
  cutEnergy(at);
  if (at < it_.event) {  // the modes at its end have not come
    statistics().mode_changes -= last_events_;
    event_count_ -= last_events_;
  }
  if (host_->cut(at) != SCENE_OK) {
    stop(StopReason::kProjectionFailed);
    return false;
  }
  host_->leave(&it_);
  has_step_ = is_still_ = false;
  return true;
}

void ProgramMotion::changeInputs() {
  rhythm_.note(time);
  if (is_integrated_) {
    commandIntegrated();
    return;
  }
  if (!cut()) return;
  forgetSample();
  const double now = signalTime();
  CommandSignal before[kMaxInputs];
  std::copy_n(signal_, scene.inputCount(), before);
  const TimeOrigin origin = signal_origin_;
  signal_origin_.moveTo(time);
  bool jumps = false;
  for (int i = 0; i < scene.inputCount(); ++i) {
    CommandSignal& signal = signal_[i];
    if (signal.segmentEnd() <= now) signal.finishSegment();
    signal.moveOrigin(now);
    if (!commands.hasCommand(i) || signal.target() == commands.value(i)) continue;
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    jumps = signal.command(input, 0.0, commands.value(i), resolutionOf(time)) || jumps;
  }
  describeInputs();
  const scene_status status = host_->change(&it_);
  if (jumps && status == SCENE_OK) ++statistics().jumps;
  noteEvents();
  last_events_ = 0;
  if (motion_ == nullptr) {
    if (status != SCENE_OK) stop(status);
    return;
  }
  if (status != SCENE_OK) {
    // The integrator tells why, or finds a way.
    std::copy_n(before, scene.inputCount(), signal_);
    signal_origin_ = origin;
    handOver(patience_);
    commandIntegrated();
    return;
  }
  host_->leave(&it_);
  const bool is_at_rest = std::all_of(state_ + scene.shaftCount(), state_ + 2 * scene.shaftCount(),
                                      [](double velocity) { return velocity == 0.0; });
  if (is_at_rest && scene.solver.sleep) handOver(0);
}

void ProgramMotion::changeInitialInputs() {
  if (is_integrated_) {
    commandIntegrated();
    return;
  }
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (!commands.hasCommand(i)) continue;
    signal_[i].command(scene.inputs[static_cast<std::size_t>(i)], 0.0, commands.value(i));
  }
  const scene_status status = start();
  if (status != SCENE_OK) stop(status);
}

// --- samples ---------------------------------------------------------------------------------

void ProgramMotion::takeSample(Sample* sample) {
  if (is_integrated_) {
    integrated().takeSample(sample);
    time = motion_->time;
    return;
  }
  vs_seen_hold seen_hold[kMaxHolds];
  double on_shaft[kMaxHolds * kMaxShafts];
  vs_seen seen = {sample->angle,
                  sample->velocity,
                  sample->acceleration,
                  sample->applied_torque,
                  sample->reaction_torque,
                  sample->reaction_torque_rate,
                  sample->residual,
                  sample->multiplier,
                  0.0,
                  seen_hold,
                  on_shaft,
                  seen_input_};
  const scene_status status = host_->see(insideStep(time), &seen);
  kinetic_ = seen.kinetic;
  for (int h = 0; h < program_->HOLDS; ++h) {
    const vs_seen_hold& from = seen_hold[h];
    HeldElement& held = held_[h];
    held = {from.mode, from.torque, from.slip, from.reserve, from.heat, {}};
    std::copy_n(on_shaft + h * scene.shaftCount(), scene.shaftCount(), held.on_shaft);
    input_value_[kMaxInputs + h] = from.side;
  }
  if (status == SCENE_OK || !this->status().ok()) return;
  if (motion_ == nullptr) {
    stop(reasonOf(status));
  } else {
    motion_->integrator.stopAtBadValue(time, 0.0, State(motion_->system.size()));
  }
}

StateView ProgramMotion::view() {
  if (is_integrated_) {
    integrated().forgetSample();
    return motion_->view();
  }
  const Sample& now = sample();
  const double at = signalTime();
  for (int i = 0; i < scene.inputCount(); ++i) {
    CommandSignal signal = signal_[i];
    if (signal.segmentEnd() <= at) signal.finishSegment();
    input_value_[i] = signal.value(at);
    input_rate_[i] = signal.rate(at);
    input_second_rate_[i] = signal.secondRate(at);
    const InputKind kind = scene.inputs[static_cast<std::size_t>(i)].kind;
    if (kind != InputKind::kCommanded) input_value_[i] = seen_input_[i];
  }
  return {time,         now.angle,   now.velocity,       now.acceleration,
          input_value_, input_rate_, input_second_rate_, program_->HOLDS > 0 ? held_ : nullptr};
}

Energy ProgramMotion::calcEnergy() {
  if (is_integrated_) {
    integrated().forgetSample();
    return motion_->calcEnergy();
  }
  Sample& now = sample();
  Energy energy;
  energy.kinetic = kinetic_;
  energy.applied = has_step_ ? applied_before_ + host_->calcWork(insideStep(time)) : applied_;
  energy.reactions = energy.kinetic - start_kinetic_ - energy.applied;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    energy.applied_power += now.applied_torque[i] * now.velocity[i];
    energy.reaction_power += now.reaction_torque[i] * now.velocity[i];
  }
  return energy;
}

// --- states ----------------------------------------------------------------------------------

bool ProgramMotion::saveState(MotionState* state) {
  settle();
  if (motion_ != nullptr) return saveIntegrated(state);
  if (!status_.ok() || !cut()) return false;
  const int S = scene.shaftCount();
  host_->leave(&it_);
  takeMemory();
  *state = MotionState{};
  state->time = time;
  std::copy_n(state_, S, state->angle);
  std::copy_n(state_ + S, S, state->velocity);
  std::copy_n(state_ + 2 * S, S, state->acceleration);
  writeInputs(state);
  state->history.exists = true;
  std::copy_n(longest_, scene.constraintCount(), state->history.longest_row);
  state->history.has_multipliers = true;
  std::copy_n(multiplier_, scene.constraintCount(), state->history.multiplier);
  saveHeld(state->history.held);
  state->history.kept_reaction.exists = true;
  std::copy_n(reaction_, S, state->history.kept_reaction.value);
  state->history.energy.start_kinetic = start_kinetic_;
  state->history.energy.applied = applied_;
  return goOnFrom(*state, false) == SCENE_OK;
}

/// (It begins as one that the state is given to.)
bool ProgramMotion::saveIntegrated(MotionState* state) {
  if (!is_integrated_ && status().ok()) {
    if (!cut()) return false;
    handOver(0);
  }
  const bool is_saved = integrated().saveState(state);
  time = motion_->time;
  forgetSample();
  steps_left_ = 0;
  patience_ = kFirstPatience;
  rhythm_.reset();
  progress_.begin(time);
  for (int i = 0; i < scene.inputCount(); ++i) state->last_command[i] = commands.lastTime(i);
  return is_saved;
}

scene_status ProgramMotion::goOnFrom(const MotionState& state, bool may_move) {
  const int S = scene.shaftCount();
  time = state.time;
  status_ = MotionStatus{};
  is_start_ = false;
  commands.reset();
  rhythm_.reset();
  progress_.begin(time);
  signal_origin_.moveTo(time);
  for (int i = 0; i < scene.inputCount(); ++i) {
    signal_[i] = state.signal[i];
    commands.setLastTime(i, state.last_command[i]);
  }
  std::copy_n(state.angle, S, state_);
  std::copy_n(state.velocity, S, state_ + S);
  std::copy_n(state.acceleration, S, state_ + 2 * S);
  std::copy_n(state.history.longest_row, scene.constraintCount(), longest_);
  std::copy_n(state.history.multiplier, scene.constraintCount(), multiplier_);
  restoreHeld(state.history.held);
  std::copy_n(state.history.kept_reaction.value, S, reaction_);
  std::fill_n(armed_, kMaxEvents, 0);
  it_.time = time;
  it_.time_rest = 0.0;
  it_.are_given = state.is_acceleration_given ? 1 : 0;
  it_.may_move = may_move ? 1 : 0;
  const scene_status status = begin(state.history.exists ? Begin::kSaved : Begin::kWritten);
  if (state.history.exists) {
    start_kinetic_ = state.history.energy.start_kinetic;
    applied_ = applied_before_ = state.history.energy.applied;
  } else {
    start_kinetic_ = calcEnergy().kinetic;
  }
  return status;
}

std::string ProgramMotion::setState(const MotionState& state, bool project) {
  MotionState before;
  if (!saveState(&before)) return "the motion has stopped";
  if (motion_ != nullptr) {
    std::string fault = motion_->setState(state, project);
    time = motion_->time;
    const MotionState& now = fault.empty() ? state : before;
    commands.reset();
    for (int i = 0; i < scene.inputCount(); ++i) commands.setLastTime(i, now.last_command[i]);
    progress_.begin(time);
    return fault;
  }
  const scene_status status = goOnFrom(state, project);
  if (status == SCENE_OK && status_.ok()) return "";
  std::string fault =
      status == SCENE_INCONSISTENT
          ? "the velocities or accelerations do not satisfy the constraints; 'project' moves them"
          : std::string("the motion cannot go on from there: ") + toString(reasonOf(status));
  goOnFrom(before, false);
  return fault;
}

void ProgramMotion::saveHeld(HeldState* held) const {
  for (int h = 0; h < program_->HOLDS; ++h) {
    const int row = program_->CONSTRAINTS + h;
    held[h] = {hold_[h].mode, hold_[h].counts,  hold_[h].side,
               hold_[h].heat, multiplier_[row], longest_[row]};
  }
}

void ProgramMotion::restoreHeld(const HeldState* held) {
  for (int h = 0; h < program_->HOLDS; ++h) {
    hold_[h] = {held[h].mode, held[h].counts, held[h].side, held[h].heat};
    multiplier_[program_->CONSTRAINTS + h] = held[h].multiplier;
    longest_[program_->CONSTRAINTS + h] = held[h].longest_row;
  }
}

// --- changes of modes ------------------------------------------------------------------------

void ProgramMotion::noteEvents() {
  last_events_ = static_cast<std::size_t>(it_.event_count);
  statistics().mode_changes += last_events_;
  for (int n = 0; n < it_.event_count; ++n) {
    const scene_event& from = it_.events[n];
    events_[event_count_++ % kMostEvents] = {from.time, from.element, from.from,
                                             from.to,   from.torque,  from.impulse};
  }
}

bool ProgramMotion::takeModeEvent(ModeEvent* event) {
  if (event_count_ > kMostEvents) first_event_ = std::max(first_event_, event_count_ - kMostEvents);
  if (first_event_ >= event_count_) return false;
  *event = events_[first_event_ % kMostEvents];
  if (event->time > time) return false;
  ++first_event_;
  return true;
}

// --- descriptions ----------------------------------------------------------------------------

void ProgramMotion::throwInitialError(scene_status status) {
  const bool is_inconsistent = status == SCENE_INCONSISTENT;
  host_->leave(&it_);
  if (is_inconsistent && program_->HOLDS > 0 && it_.culprit >= 0) throwInitialMode();
  const char* const key =
      scene.initial.acceleration.empty() ? "initial/velocity" : "initial/acceleration";
  throw SceneError(
      key, is_inconsistent
               ? "does not satisfy the constraints; 'initial/project: true' starts at the nearest "
                 "values that do"
               : std::string("no motion begins here: ") + explain(reasonOf(status)) +
                     scene.extreme_numbers);
}

void ProgramMotion::trackEnergy(bool on) {
  is_energy_tracked_ = on;
  if (motion_ != nullptr) motion_->trackEnergy(on);
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

std::vector<std::string> ProgramMotion::skips() const {
  return motion_ != nullptr ? motion_->skips() : std::vector<std::string>{};
}

void ProgramMotion::throwInitialMode() {
  const auto element = static_cast<std::size_t>(it_.culprit);
  const std::string torque = formatNumber(it_.culprit_torque) + " N m";
  const bool is_stuck =
      program_->begins_in.values[element] == static_cast<int>(Holding::Begin::kStuck);
  std::string fault = "'slipping': it holds at the start, with " + torque;
  if (is_stuck) {
    fault = std::abs(it_.culprit_slip) > scene.solver.absolute_tolerance
                ? "'stuck': its slip is " + formatNumber(it_.culprit_slip) + " rad/s at the start"
                : "'stuck': it would have to hold " + torque + " at the start";
  }
  throw SceneError(program_->holdNames()[element] + "/initial",
                   fault + "; allowed: auto, or a start to which it belongs");
}

std::string ProgramMotion::describeStop() {
  if (motion_ != nullptr) {
    integrated().forgetSample();
    return motion_->describeStop();
  }
  if (status_.ok()) return "";
  const int S = scene.shaftCount();
  const StateView state = view();
  std::ostringstream text;
  text << toString(status_.reason) << " at t = " << formatNumber(status_.time)
       << " s: " << explain(status_.reason)
       << "; last good state: angle = " << formatNumbers(state.angle, S)
       << " rad, velocity = " << formatNumbers(state.velocity, S)
       << " rad/s, acceleration = " << formatNumbers(state.acceleration, S) << " rad/s^2";
  const int event = it_.passed - program_->FIRST_EVENT;
  if (status_.reason == StopReason::kChattering && event >= 0 && event < program_->EVENTS) {
    text << "; the event " << inQuotes(scene.events[static_cast<std::size_t>(event)].name)
         << " came last: what it sets must not set it off again at once";
  }
  text << scene.extreme_numbers;
  return text.str();
}

std::string ProgramMotion::describeStepper() const {
  return motion_ != nullptr ? motion_->describeStepper() : "taylor (the scene's own program)";
}

// --- machine code ----------------------------------------------------------------------------

bool ProgramMotion::use(const std::shared_ptr<KernelLibrary>& library) {
  std::unique_ptr<HostedMotion> compiled = hostMotion(library, *program_);
  if (compiled == nullptr) return false;
  // The next step has to be that of the interpreter.
  const std::unique_ptr<HostedMotion> interpreted = hostMotion(*program_);
  double state[2][3 * kMaxShafts] = {};
  double length[2] = {};
  vs_exchanged_signal input[kMaxInputs] = {};
  scene_status status[2];
  int n = 0;
  for (HostedMotion* const tried : {interpreted.get(), compiled.get()}) {
    if (is_integrated_) {
      describeIntegrated();
    } else {
      host_->leave(&it_);
    }
    vs_exchange from = it_;
    from.begin = static_cast<int>(Begin::kSaved);
    status[n] = tried->begin(from);
    vs_exchange made = from;
    made.state = state[n];
    made.input = input;
    if (status[n] == SCENE_OK) status[n] = tried->step(kFirstUnit, &made);
    if (status[n] == SCENE_OK) tried->leave(&made);
    length[n++] = made.made;
  }
  const bool is_right =
      status[0] == status[1] &&
      (status[0] != SCENE_OK ||
       (length[0] == length[1] && std::equal(state[0], std::end(state[0]), state[1])));
  if (!is_right) return false;
  next_host_ = std::move(compiled);
  library_ = library;
  return true;
}

std::string ProgramMotion::loadCode(KernelLibrary::Missing missing, bool* compiled) {
  const MoreCode code = {program_->writeKernel(), [this](const auto& made) { return use(made); }};
  if (motion_ != nullptr) return motion_->loadCodeWith(code, missing, compiled);
  std::string reason;
  const auto library =
      KernelLibrary::load(KernelLibrary::kUnits + code.source, missing, &reason, code.use);
  *compiled = library != nullptr && library->wasCompiled();
  return reason;
}

bool ProgramMotion::shareMachineCode(const MotionBase& other) {
  const auto* const like = dynamic_cast<const ProgramMotion*>(&other);
  if (like == nullptr || like->library_ == nullptr) return false;
  if (program_->structure() != like->program_->structure()) return false;
  if (motion_ != nullptr && !motion_->shareMachineCode(*like->motion_)) return false;
  return use(like->library_);
}

}  // namespace variator_sim
