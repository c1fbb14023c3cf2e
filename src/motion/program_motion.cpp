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
    case SCENE_STEP_TOO_LARGE:
      return StopReason::kStepTooLarge;
    case SCENE_OK:
      break;
  }
  return StopReason::kNone;
}

ProgramMotion::ProgramMotion(Scene its_scene, std::shared_ptr<const MotionProgram> program,
                             bool has_finder, const ProgramMotion* like)
    : MotionBase(std::move(its_scene)),
      program_(std::move(program)),
      finder_(has_finder ? std::make_unique<StateFinder>(
                               scene, like != nullptr ? like->finder_.get() : nullptr)
                         : nullptr),
      host_(hostMotion(*program_)),
      past_(*program_),
      progress_(scene.solver.maximum_steps),
      energy_(scene, !has_finder || finder_->system().drivetrain().hasConstantJacobian(),
              scene.shaftCount()) {
  it_.state = state_;
  it_.multiplier = multiplier_;
  it_.reaction = reaction_;
  it_.longest = longest_;
  it_.input = input_;
  entries_.resize(static_cast<std::size_t>(program_->K) * scene.shafts.size());
  it_.hold = hold_;
  if (program_->HOLDS > 0 || program_->EVENTS > 0) events_.resize(kMostEvents);
  it_.armed = armed_;
  it_.past = past_.data();
  reset();
  if (finder_ != nullptr) finder_->requireConsistency();
  if (like != nullptr) useCodeOf(*like);
}

// --- beginnings ------------------------------------------------------------------------------

void ProgramMotion::reset() {
  time = 0.0;
  forgetSample();
  commands.reset();
  rhythm_.reset();
  progress_.begin(0.0);
  it_.choice = {};
  status_ = MotionStatus{};
  statistics_ = Statistics{};
  signal_origin_ = 0.0;
  for (int i = 0; i < scene.inputCount(); ++i) {
    signal_[i].reset(scene.inputs[static_cast<std::size_t>(i)]);
  }
  is_start_ = true;
  first_event_ = event_count_ = last_events_ = 0;
  start();
}

void ProgramMotion::start() {
  const int S = scene.shaftCount();
  std::fill_n(state_, 3 * S, 0.0);
  std::fill_n(multiplier_, kMostRows, 0.0);
  std::fill_n(reaction_, kMaxShafts, 0.0);
  std::fill_n(longest_, kMostRows, 0.0);
  it_.time = it_.time_rest = 0.0;
  if (finder_ == nullptr) {
    const InitialConditions& initial = scene.initial;
    std::copy(initial.angle.begin(), initial.angle.end(), state_);
    std::copy(initial.velocity.begin(), initial.velocity.end(), state_ + S);
    std::copy(initial.acceleration.begin(), initial.acceleration.end(), state_ + 2 * S);
    it_.are_given = initial.acceleration.empty() ? 0 : 1;
    it_.may_move = initial.project ? 1 : 0;
    const scene_status status = begin(Begin::kStart);
    if (status != SCENE_OK && commands.isEmpty()) throwInitialError(status);
    if (status != SCENE_OK) stop(status);
  } else {
    finder_->enterInputs(signal_, 0.0);
    const bool is_found = finder_->findFirst();
    finder_->write(state_, multiplier_);
    it_.are_given = it_.may_move = 1;
    const scene_status status = begin(is_found ? Begin::kStart : Begin::kSaved);
    if (!is_found) {
      status_ = finder_->explainStart();
    } else if (status != SCENE_OK) {
      stop(status);
    }
  }
  energy_.begin(calcKineticEnergy());
  forgetSample();
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
  if (next_host_ != nullptr) host_ = std::move(next_host_);
  it_.begin = static_cast<int>(Begin::kSaved);
  host_->begin(it_);
}

// --- steps -----------------------------------------------------------------------------------

bool ProgramMotion::step(double /*end*/) {
  if (!progress_.count(frontTime())) {
    stop(StopReason::kStepLimit);
    status_.time = frontTime();
    status_.measure = progress_.rateAt(frontTime());
    return false;
  }
  if (progress_.areRefused()) {
    stop(StopReason::kToleranceTooSmall);
    status_.time = frontTime();
    return false;
  }
  // (Implicit steps begin Newton's iteration at the last one, which a beginning forgets.)
  const bool is_due = made_since_ > 0 && made_since_ % kMostBetween == 0;
  if (is_due || (next_host_ != nullptr && !isImplicit())) beginAnew();
  const double expected = sinceFront(rhythm_.next());
  const double left =
      expected > 2.0 * resolutionOf(frontTime()) ? std::min(kLongestStep, expected) : kLongestStep;
  begin_ = it_.time;
  begin_rest_ = it_.time_rest;
  const int method = it_.choice.method;
  const scene_status status = host_->step(left, &it_);
  statistics_.rejected_steps += static_cast<std::uint64_t>(it_.rejections);
  statistics_.largest_error_estimate = std::max(statistics_.largest_error_estimate, it_.error);
  if (it_.rounding > 1.0)
    statistics_.largest_rounding = std::max(statistics_.largest_rounding, it_.rounding);
  has_step_ = status == SCENE_OK;
  forgetSample();
  if (!has_step_) {
    stop(status);
    return false;
  }
  noteEvents();
  ++made_since_;
  ++statistics_.steps;
  ++statistics_.right_hand_sides;
  if (program_->CHOOSES_METHOD != 0 && it_.choice.method != method) ++statistics_.stepper_switches;
  if (it_.is_implicit != 0) ++statistics_.implicit_steps;
  (program_->IS_CLASSICAL != 0 ? statistics_.newton_iterations : statistics_.projections) +=
      static_cast<std::uint64_t>(it_.corrections);
  if (it_.passed >= 0 || it_.is_event != 0) ++statistics_.kinks;
  if (it_.is_still != 0 && !is_still_) ++statistics_.sleeps;
  is_still_ = it_.is_still != 0;
  noteEnergy();
  progress_.noteRefusals(it_.rejections);
  return true;
}

void ProgramMotion::recover() {
  has_step_ = is_still_ = false;
  begin_ = it_.time;
  begin_rest_ = it_.time_rest;
  time = frontTime();
  forgetSample();
}

double ProgramMotion::lastInside() const {
  const double reached = frontTime();
  return sinceFront(reached) > 0.0 ? std::nextafter(reached, 0.0) : reached;
}

void ProgramMotion::stop(scene_status status) {
  stop(reasonOf(status));
  status_.time = status == SCENE_NO_MODES ? std::max(it_.stopped, frontTime()) : frontTime();
  double input[kMaxInputs];
  for (int i = 0; i < scene.inputCount(); ++i) {
    input[i] = signal_[i].value(frontTime() - signal_origin_);
  }
  StateView front{};
  front.time = frontTime();
  front.angle = state_;
  front.input = input;
  if (quantities.isInertiaLost(front)) status_.reason = StopReason::kIndefiniteInertia;
  host_->leave(&it_);
  if (status == SCENE_STEP_TOO_LARGE) {
    status_.measure = it_.error * scene.solver.relative_tolerance;
    return;
  }
  if (finder_ != nullptr && status != SCENE_CHATTERING) explainStop();
  // (Of accelerations that follow from the state: those of gauss.)
  const bool is_lost = it_.rounding > 1.0 && status_.reason == StopReason::kStepUnderflow;
  if (!is_lost || status != SCENE_TOO_MANY_STEPS) return;
  status_.reason = StopReason::kToleranceTooSmall;
  status_.measure = it_.rounding;
}

void ProgramMotion::explainStop() {
  CommandSignal now[kMaxInputs];
  const double at = (it_.time - signal_origin_) + it_.time_rest;
  for (int i = 0; i < scene.inputCount(); ++i) {
    now[i] = signal_[i];
    if (now[i].segmentEnd() <= at) now[i].finishSegment();
    now[i].moveOrigin(at);
  }
  if (status_.reason == StopReason::kJumpFailed) {
    if (scene.constraintCount() == 1) status_.constraint = 0;
    return;
  }
  // (Where a formula has no series steps end, too.)
  if (status_.reason == StopReason::kNonFiniteValue) status_.reason = StopReason::kStepUnderflow;
  finder_->enterInputs(now, frontTime());
  finder_->explainStop(state_, longest_, &status_);
}

// --- commands --------------------------------------------------------------------------------

bool ProgramMotion::cut() {
  if (!has_step_) return true;
  const double at = insideStep(time);
  double through = 0.0;
  const double work = host_->calcWork(at, &through);
  if (at < it_.event) {  // the modes at its end have not come
    statistics_.mode_changes -= last_events_;
    event_count_ -= last_events_;
  }
  if (host_->cut(at) != SCENE_OK) {
    stop(StopReason::kProjectionFailed);
    return false;
  }
  host_->leave(&it_);
  has_step_ = is_still_ = false;
  energy_.cut(time, energy_.appliedBefore() + work, energy_.throughputBefore() + through, state_,
              state_ + scene.shaftCount());
  return true;
}

void ProgramMotion::changeInputs() {
  rhythm_.note(time);
  if (!cut()) return;
  forgetSample();
  const double now = signalTime();
  signal_origin_ = time;
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
  if (jumps && status == SCENE_OK) ++statistics_.jumps;
  noteEvents();
  last_events_ = 0;
  if (status != SCENE_OK) stop(status);
}

void ProgramMotion::changeInitialInputs() {
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (!commands.hasCommand(i)) continue;
    signal_[i].command(scene.inputs[static_cast<std::size_t>(i)], 0.0, commands.value(i));
  }
  start();
}

// --- samples ---------------------------------------------------------------------------------

void ProgramMotion::takeSample(Sample* sample) {
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
  if (status == SCENE_OK || !status_.ok()) return;
  stop(status);
  status_.time = time;
}

StateView ProgramMotion::view() {
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
  Sample& now = sample();
  double through = 0.0;
  const double applied = has_step_
                             ? energy_.appliedBefore() + host_->calcWork(insideStep(time), &through)
                             : energy_.account().applied;
  return energy_.report(now, kinetic_, applied);
}

double ProgramMotion::calcKineticEnergy() {
  sample();
  return kinetic_;
}

void ProgramMotion::noteEnergy() {
  double through = 0.0;
  const double work = host_->calcWork(it_.made, &through);
  if (energy_.isWatched()) {
    if (!energy_.hasDirections()) {
      host_->look(0.0, entries_.data());
      energy_.noteDirections(entries_.data(), state_);
    }
    host_->look(it_.made, entries_.data());
  }
  energy_.noteStep(frontTime(), work, through, state_, state_ + scene.shaftCount(),
                   entries_.data());
}

// --- changes of modes ------------------------------------------------------------------------

void ProgramMotion::noteEvents() {
  last_events_ = static_cast<std::size_t>(it_.event_count);
  statistics_.mode_changes += last_events_;
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
