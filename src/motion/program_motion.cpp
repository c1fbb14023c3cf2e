#include "motion/program_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

namespace {

bool searchesAccelerations(const Scene& scene) {
  return !ProgramMotion::hasMoreThanLaws(scene) &&
         std::any_of(scene.constraints.begin(), scene.constraints.end(),
                     [](const ConstraintPtr& it) { return it->nonlinearAccelerations().any(); });
}

/// True when C and J are the same at every state.
bool areRowsConstant(const Scene& scene) {
  return Inertia(scene.inertia, scene.inertia_harmonics).isConstant() &&
         std::all_of(scene.constraints.begin(), scene.constraints.end(),
                     [](const ConstraintPtr& it) { return it->hasConstantJacobian(); });
}

}  // namespace

bool ProgramMotion::hasMoreThanLaws(const Scene& scene) {
  return !scene.holdNames().empty() || !scene.nameOfDirection().empty() || scene.hasMemory() ||
         !scene.inertia_formulas.empty();
}

ProgramMotion::ProgramMotion(Scene its_scene, std::shared_ptr<const MotionProgram> program,
                             const ProgramMotion* like)
    : MotionBase(std::move(its_scene)),
      program_(std::move(program)),
      search_(searchesAccelerations(scene) ? std::make_unique<FirstAccelerations>(scene) : nullptr),
      host_(hostMotion(*program_)),
      past_(*program_),
      progress_(scene.solver.maximum_steps),
      energy_(scene, hasMoreThanLaws(scene) || areRowsConstant(scene), scene.shaftCount()) {
  entries_.resize(static_cast<std::size_t>(program_->K) * scene.shafts.size());
  if (program_->HOLDS > 0 || program_->EVENTS > 0) events_.resize(kMostEvents);
  it_.past = past_.data();
  reset();
  if (like != nullptr) useCodeOf(*like);
}

// --- beginnings ------------------------------------------------------------------------------

void ProgramMotion::reset() {
  time = scene.initial.time;
  forgetSample();
  commands.reset();
  rhythm_.reset();
  progress_.begin(time);
  it_.choice = {};
  status_ = MotionStatus{};
  statistics_ = Statistics{};
  signal_origin_ = time;
  for (int i = 0; i < scene.inputCount(); ++i) {
    signal_[i].reset(scene.inputs[static_cast<std::size_t>(i)]);
  }
  is_start_ = true;
  first_event_ = event_count_ = last_events_ = 0;
  start();
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
    it_.input[n] = {from.form,        from.start,  from.target, from.slope,
                    from.inverse_tau, from.linear, -from.since, from.end - from.since};
  }
}

void ProgramMotion::takeMemory() {
  for (int i = 0; i < scene.inputCount(); ++i) {
    const CommandInputSettings& input = scene.inputs[static_cast<std::size_t>(i)];
    if (input.kind == InputKind::kCommanded) continue;
    signal_[i].command(input, signalTime(), it_.input[i].start);
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

double ProgramMotion::lastInside() const {
  const double reached = frontTime();
  return sinceFront(reached) > 0.0 ? std::nextafter(reached, 0.0) : reached;
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
  energy_.cut(time, energy_.appliedBefore() + work, energy_.throughputBefore() + through, it_.state,
              it_.state + scene.shaftCount());
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

scene_status ProgramMotion::look(double at, Sample* sample, double* jerk) {
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
                  seen_input_,
                  jerk};
  const scene_status status = host_->see(at, &seen);
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
  return status;
}

void ProgramMotion::takeSample(Sample* sample) {
  const scene_status status = look(insideStep(time), sample, nullptr);
  if (status == SCENE_OK || !status_.ok()) return;
  stop(status);
  status_.time = time;
}

void ProgramMotion::writeInputValues(double at) {
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
}

StateView ProgramMotion::viewOf(const double* state, double at) {
  const int S = scene.shaftCount();
  writeInputValues(at - signal_origin_);
  return {at,           state,       state + S,          state + 2 * S,
          input_value_, input_rate_, input_second_rate_, program_->HOLDS > 0 ? held_ : nullptr,
          held_value_};
}

StateView ProgramMotion::view() {
  const Sample& now = sample();
  writeInputValues(signalTime());
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
      energy_.noteDirections(entries_.data(), it_.state);
    }
    host_->look(it_.made, entries_.data());
  }
  energy_.noteStep(frontTime(), work, through, it_.state, it_.state + scene.shaftCount(),
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
