#include "motion/program_motion.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

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
    case StopReason::kStepLimit:
      return "more steps than 'solver/maximum_steps' within one simulated second";
    default:
      return "no accelerations that satisfy the constraints were found";
  }
}

}  // namespace

ProgramMotion::ProgramMotion(Scene its_scene, const ProgramMotion* like)
    : MotionBase(std::move(its_scene)),
      program_(scene),
      host_(hostMotion(program_)),
      progress_(scene.solver.maximum_steps) {
  it_.state = state_;
  it_.multiplier = multiplier_;
  it_.reaction = reaction_;
  it_.longest = longest_;
  it_.input = input_;
  it_.side = side_;
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
  status_ = MotionStatus{};
  statistics_ = Statistics{};
  signal_origin_.moveTo(0.0);
  for (int i = 0; i < scene.inputCount(); ++i) {
    signal_[i].reset(scene.inputs[static_cast<std::size_t>(i)]);
  }
  is_start_ = true;
  const scene_status status = start();
  if (status != SCENE_OK) throwInitialError(status);
}

scene_status ProgramMotion::start() {
  const int S = scene.shaftCount();
  std::fill_n(state_, 3 * S, 0.0);
  std::fill_n(multiplier_, kMaxConstraints, 0.0);
  std::fill_n(reaction_, kMaxShafts, 0.0);
  std::fill_n(longest_, kMaxConstraints, 0.0);
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
    input_[n] = {from.form,
                 from.start,
                 from.target,
                 from.slope,
                 from.inverse_tau,
                 from.linear,
                 signalTime() - from.since,
                 from.end - from.since};
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

// --- steps -----------------------------------------------------------------------------------

bool ProgramMotion::step(double /*end*/) {
  if (!progress_.count(frontTime())) {
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
  const scene_status status = host_->step(left, &it_);
  statistics_.rejected_steps += static_cast<std::uint64_t>(it_.rejections);
  has_step_ = status == SCENE_OK;
  forgetSample();
  if (!has_step_) {
    stop(status);
    return false;
  }
  ++made_since_;
  ++statistics_.steps;
  if (it_.passed >= 0 || it_.is_event != 0) ++statistics_.kinks;
  if (it_.is_still != 0 && !is_still_) ++statistics_.sleeps;
  is_still_ = it_.is_still != 0;
  applied_ += host_->calcWork(it_.made);
  return true;
}

double ProgramMotion::lastInside() const {
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
  applied_ = applied_before_ + host_->calcWork(at);
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
  if (!cut()) return;
  forgetSample();
  const double now = signalTime();
  CommandSignal before[kMaxInputs];
  std::copy_n(signal_, scene.inputCount(), before);
  signal_origin_.moveTo(time);
  for (int i = 0; i < scene.inputCount(); ++i) {
    CommandSignal& signal = signal_[i];
    if (signal.segmentEnd() <= now) signal.finishSegment();
    signal.moveOrigin(now);
    if (!commands.hasCommand(i) || signal.target() == commands.value(i)) continue;
    if (signal.command(scene.inputs[static_cast<std::size_t>(i)], 0.0, commands.value(i),
                       resolutionOf(time))) {
      ++statistics_.jumps;
    }
  }
  describeInputs();
  const scene_status status = host_->change(it_);
  if (status == SCENE_OK) return;
  std::copy_n(before, scene.inputCount(), signal_);
  stop(status);
}

void ProgramMotion::changeInitialInputs() {
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (!commands.hasCommand(i)) continue;
    signal_[i].command(scene.inputs[static_cast<std::size_t>(i)], 0.0, commands.value(i));
  }
  const scene_status status = start();
  if (status != SCENE_OK) stop(status);
}

// --- samples ---------------------------------------------------------------------------------

void ProgramMotion::takeSample(Sample* sample) {
  vs_seen seen = {sample->angle,
                  sample->velocity,
                  sample->acceleration,
                  sample->applied_torque,
                  sample->reaction_torque,
                  sample->reaction_torque_rate,
                  sample->residual,
                  sample->multiplier,
                  0.0,
                  seen_input_};
  const scene_status status = host_->see(insideStep(time), &seen);
  sample->energy.kinetic = seen.kinetic;
  if (status != SCENE_OK && status_.ok()) stop(reasonOf(status));
}

StateView ProgramMotion::view() {
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
  return {time,         now.angle,   now.velocity,      now.acceleration,
          input_value_, input_rate_, input_second_rate_};
}

Energy ProgramMotion::calcEnergy() {
  Sample& now = sample();
  Energy energy;
  energy.kinetic = now.energy.kinetic;
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
  state->history.kept_reaction.exists = true;
  std::copy_n(reaction_, S, state->history.kept_reaction.value);
  state->history.energy.start_kinetic = start_kinetic_;
  state->history.energy.applied = applied_;
  return goOnFrom(*state, false) == SCENE_OK;
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
  std::copy_n(state.history.kept_reaction.value, S, reaction_);
  std::fill_n(side_, kMaxEvents, 0);
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
  const scene_status status = goOnFrom(state, project);
  if (status == SCENE_OK && status_.ok()) return "";
  const std::string fault =
      status == SCENE_INCONSISTENT
          ? "the velocities or accelerations do not satisfy the constraints; 'project' moves them"
          : std::string("the motion cannot go on from there: ") + toString(reasonOf(status));
  goOnFrom(before, false);
  return fault;
}

// --- descriptions ----------------------------------------------------------------------------

void ProgramMotion::throwInitialError(scene_status status) {
  const bool is_inconsistent = status == SCENE_INCONSISTENT;
  const char* const key =
      scene.initial.acceleration.empty() ? "initial/velocity" : "initial/acceleration";
  throw SceneError(
      key, is_inconsistent
               ? "does not satisfy the constraints; 'initial/project: true' starts at the nearest "
                 "values that do"
               : std::string("no motion begins here: ") + explain(reasonOf(status)) +
                     scene.extreme_numbers);
}

std::string ProgramMotion::describeStop() {
  if (status_.ok()) return "";
  const int S = scene.shaftCount();
  const StateView state = view();
  std::ostringstream text;
  text << toString(status_.reason) << " at t = " << formatNumber(status_.time)
       << " s: " << explain(status_.reason)
       << "; last good state: angle = " << formatNumbers(state.angle, S)
       << " rad, velocity = " << formatNumbers(state.velocity, S)
       << " rad/s, acceleration = " << formatNumbers(state.acceleration, S) << " rad/s^2";
  const int event = it_.passed - program_.FIRST_EVENT;
  if (status_.reason == StopReason::kChattering && event >= 0 && event < program_.EVENTS) {
    text << "; the event " << inQuotes(scene.events[static_cast<std::size_t>(event)].name)
         << " came last: what it sets must not set it off again at once";
  }
  text << scene.extreme_numbers;
  return text.str();
}

std::string ProgramMotion::describeStepper() const {
  return "taylor (the scene's own program)";
}

// --- machine code ----------------------------------------------------------------------------

bool ProgramMotion::use(const std::shared_ptr<KernelLibrary>& library) {
  std::unique_ptr<HostedMotion> compiled = hostMotion(library, program_);
  if (compiled == nullptr) return false;
  // The first step has to be that of the interpreter.
  const std::unique_ptr<HostedMotion> interpreted = hostMotion(program_);
  host_->leave(&it_);
  double state[2][3 * kMaxShafts] = {};
  double length[2] = {};
  vs_exchanged_signal input[kMaxInputs] = {};
  scene_status status[2];
  int n = 0;
  for (HostedMotion* const tried : {interpreted.get(), compiled.get()}) {
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
  std::string reason;
  const auto library = KernelLibrary::load(program_.writeKernel(true), missing, &reason,
                                           [this](const auto& made) { return use(made); });
  *compiled = library != nullptr && library->wasCompiled();
  return reason;
}

bool ProgramMotion::shareMachineCode(const MotionBase& other) {
  const auto* const like = dynamic_cast<const ProgramMotion*>(&other);
  return like != nullptr && like->library_ != nullptr &&
         program_.structure() == like->program_.structure() && use(like->library_);
}

}  // namespace variator_sim
