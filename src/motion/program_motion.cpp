#include "motion/program_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "variator_sim/errors.h"

namespace variator_sim {

namespace {

/// s: the longest step, whose powers do not overflow.
constexpr double kLongestStep = 1e6;

}  // namespace

StopReason ProgramMotion::reasonOf(scene_status status) {
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

ProgramMotion::ProgramMotion(Scene its_scene, std::shared_ptr<const MotionProgram> program,
                             std::unique_ptr<Motion> integrator, const ProgramMotion* like)
    : MotionBase(std::move(its_scene)),
      motion_(std::move(integrator)),
      program_(std::move(program)),
      host_(hostMotion(*program_)),
      past_(*program_),
      progress_(scene.solver.maximum_steps) {
  it_.state = state_;
  it_.multiplier = multiplier_;
  it_.reaction = reaction_;
  it_.longest = longest_;
  it_.input = input_;
  if (motion_ != nullptr) {
    entries_.resize(static_cast<std::size_t>(program_->K) * scene.shafts.size());
    rows_ = std::make_unique<double[][kMaxShafts]>(static_cast<std::size_t>(program_->K));
  }
  it_.hold = hold_;
  if (program_->HOLDS > 0 || program_->EVENTS > 0) events_.resize(kMostEvents);
  it_.armed = armed_;
  it_.past = past_.data();
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
  switches_ = 0;
  it_.choice = {};
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
  host_->leave(&it_);
  noteRounding();
  if (next_host_ != nullptr) host_ = std::move(next_host_);
  it_.begin = static_cast<int>(Begin::kSaved);
  host_->begin(it_);
}

void ProgramMotion::leaveStart() {
  is_start_ = false;
  if (is_integrated_) motion_->leaveStart();
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
  if (progress_.areRefused()) {
    if (motion_ != nullptr) {
      handOverPatiently();
      return stepIntegrated(end);
    }
    stop(StopReason::kToleranceTooSmall);
    status_.time = frontTime();
    return false;
  }
  // (Implicit steps begin Newton's iteration at the last one, which a beginning forgets.)
  const bool is_due = made_since_ > 0 && made_since_ % kMostBetween == 0;
  if (is_due || (next_host_ != nullptr && !isImplicit())) beginAnew();
  const double expected = sinceFront(rhythm_.next());
  const double longest = std::min(scene.solver.maximum_step, kLongestStep);
  const double left =
      expected > 2.0 * resolutionOf(frontTime()) ? std::min(longest, expected) : longest;
  begin_ = it_.time;
  begin_rest_ = it_.time_rest;
  applied_before_ = applied_;
  std::copy_n(state_, 3 * scene.shaftCount(), before_);
  const int method = it_.choice.method;
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
    // (Steps that time does not resolve, none of which was refused, are those of a pole.)
    const bool has_no_series =
        status == SCENE_NOT_FINITE || (status == SCENE_TOO_MANY_STEPS && it_.rejections > 0);
    handOverPatiently();
    if (has_no_series) motion_->integrator.giveUpSeries();
    return stepIntegrated(end);
  }
  noteEvents();
  ++made_since_;
  ++counted.steps;
  if (it_.choice.method != method) ++switches_;
  if (method != 0) ++counted.implicit_steps;
  if (it_.passed >= 0 || it_.is_event != 0) ++counted.kinks;
  if (motion_ == nullptr && it_.is_still != 0 && !is_still_) ++counted.sleeps;
  is_still_ = it_.is_still != 0;
  noteEnergy();
  if (motion_ != nullptr) motion_->drivetrain.countRightHandSide();
  progress_.noteRefusals(it_.rejections);
  return true;
}

double ProgramMotion::lastInside() const {
  if (is_integrated_) return motion_->lastInside();
  const double reached = frontTime();
  return sinceFront(reached) > 0.0 ? std::nextafter(reached, 0.0) : reached;
}

void ProgramMotion::stop(scene_status status) {
  stop(reasonOf(status));
  status_.time = status == SCENE_NO_MODES ? std::max(it_.stopped, frontTime()) : frontTime();
  double input[kMaxInputs];
  for (int i = 0; i < scene.inputCount(); ++i) {
    input[i] = signal_[i].value(signal_origin_.relative(frontTime()));
  }
  StateView front{};
  front.time = frontTime();
  front.angle = state_;
  front.input = input;
  if (quantities.isInertiaLost(front)) status_.reason = StopReason::kIndefiniteInertia;
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
                  sample->reaction_torque_covariant_rate,
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
    const auto valueOf = [&](expression::HeldValue value) -> double& {
      return held_value_[expression::heldSlot(value, h)];
    };
    valueOf(expression::HeldValue::kMultiplier) = from.multiplier;
    valueOf(expression::HeldValue::kMode) = from.mode;
    valueOf(expression::HeldValue::kCounts) = from.counts;
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
    CommandSignal::Moment moment = signal.at(at);
    const InputKind kind = scene.inputs[static_cast<std::size_t>(i)].kind;
    if (kind != InputKind::kCommanded) moment.value = seen_input_[3 * i];
    if (kind == InputKind::kDelayed) {
      moment.rate = seen_input_[3 * i + 1];
      moment.second_rate = seen_input_[3 * i + 2];
    }
    input_value_[i] = moment.value;
    input_rate_[i] = moment.rate;
    input_second_rate_[i] = moment.second_rate;
  }
  return {time,         now.angle,   now.velocity,       now.acceleration,
          input_value_, input_rate_, input_second_rate_, program_->HOLDS > 0 ? held_ : nullptr,
          held_value_};
}

Energy ProgramMotion::calcEnergy() {
  if (is_integrated_) {
    integrated().forgetSample();
    return motion_->calcEnergy();
  }
  Sample& now = sample();
  double through = 0.0;
  Energy energy;
  energy.kinetic = kinetic_;
  energy.applied =
      has_step_ ? applied_before_ + host_->calcWork(insideStep(time), &through) : applied_;
  energy.reactions = energy.kinetic - start_kinetic_ - energy.applied;
  for (int i = 0; i < scene.shaftCount(); ++i) {
    energy.applied_power += now.applied_torque[i] * now.velocity[i];
    energy.reaction_power += now.reaction_torque[i] * now.velocity[i];
  }
  return energy;
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

}  // namespace variator_sim
