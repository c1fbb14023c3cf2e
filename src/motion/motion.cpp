#include "motion/motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "variator_sim/errors.h"
#include "variator_sim/interruption.h"
#include "variator_sim/operating_point.h"

namespace variator_sim {

namespace {

/// s: the longest step, whose powers do not overflow.
constexpr double kLongestStep = 1e6;

/// True when C and J are the same at every state.
bool areRowsConstant(const Scene& scene) {
  return Inertia(scene.inertia, scene.inertia_harmonics).isConstant() &&
         std::all_of(scene.constraints.begin(), scene.constraints.end(),
                     [](const ConstraintPtr& it) { return it->hasConstantJacobian(); });
}

}  // namespace

bool hasMoreThanLaws(const Scene& scene) {
  return !scene.holdNames().empty() || !scene.nameOfDirection().empty() || scene.hasMemory() ||
         !scene.inertia_formulas.empty();
}

Motion::Motion(Scene its_scene, const Motion* like)
    : scene(std::move(its_scene)),
      inputs(scene),
      program(scene, inputs),
      quantities(scene),
      beginning(*this),
      energy(scene, hasMoreThanLaws(scene) || areRowsConstant(scene)),
      events(program.text()),
      progress(scene.solver.maximum_steps) {
  entries_.resize(static_cast<std::size_t>(program.text().K) * scene.shafts.size());
  reset();
  if (like != nullptr) program.shareCode(like->program);
}

void Motion::reset() {
  time = scene.initial.time;
  inputs.reset(time);
  progress.begin(time);
  program.it.choice = {};
  status = MotionStatus{};
  statistics = Statistics{};
  is_start_ = true;
  events.reset();
  start();
}

void Motion::start() {
  const int S = scene.shaftCount();
  Exchange& it = program.it;
  std::fill_n(it.state, 3 * S, 0.0);
  std::fill_n(it.multiplier, Exchange::kMostRows, 0.0);
  std::fill_n(it.reaction, kMaxShafts, 0.0);
  std::fill_n(it.longest, Exchange::kMostRows, 0.0);
  it.time = time;
  it.time_rest = 0.0;
  const InitialConditions& initial = scene.initial;
  std::copy(initial.angle.begin(), initial.angle.end(), it.state);
  std::copy(initial.velocity.begin(), initial.velocity.end(), it.state + S);
  std::copy(initial.acceleration.begin(), initial.acceleration.end(), it.state + 2 * S);
  const scene_status began =
      beginning.findNear(Beginning::Begin::kStart, !initial.acceleration.empty(), initial.project);
  if (began != SCENE_OK && status.ok()) {
    if (!inputs.isAnyWaiting()) beginning.throwFault(began);
    stop(reasonOf(began), time);
  }
  program.leave();
  std::copy_n(it.state, 3 * S, first_);
  beginEnergy();
}

// --- the current time ------------------------------------------------------------------------

const MotionStatus& Motion::advanceTo(double end) {
  if (!(end > time)) return status;
  if (end <= quiet_until_ && status.ok() && !inputs.isAnyWaiting()) {
    time = end;
    is_sample_valid_ = false;
    return status;
  }
  settle();
  is_start_ = false;
  // Timeouts of commands are events of the motion and act without a caller.
  for (double timeout = inputs.nextTimeout(); status.ok() && timeout <= end;
       timeout = inputs.nextTimeout()) {
    moveTo(std::max(timeout, time));    // a rounding may lie between them
    if (time < timeout) return status;  // interrupted
    if (status.ok()) {
      statistics.command_timeouts += static_cast<std::uint64_t>(inputs.addTimeouts(time));
    }
    if (timeout < end) settle();
  }
  moveTo(end);
  return status;
}

void Motion::moveTo(double end) {
  if (!status.ok()) return;
  bool goes_on = true;
  while (goes_on && program.sinceFront(end) > 0.0) goes_on = !Interruption::isWanted() && step();
  time = goes_on ? end : (status.ok() ? quietUntil() : status.time);  // or interrupted
  forgetSample();
  // At a timeout its command acts.
  quiet_until_ = std::min(quietUntil(), std::nextafter(inputs.nextTimeout(), -1.0));
}

double Motion::quietUntil() const {
  if (!status.ok() || inputs.isAnyWaiting()) return time;
  return std::max(time, std::min(lastInside(), inputs.nextTimeout()));
}

double Motion::lastInside() const {
  const double reached = program.front();
  return program.sinceFront(reached) > 0.0 ? std::nextafter(reached, 0.0) : reached;
}

bool Motion::step() {
  const double front = program.front();
  if (!progress.count(front)) {
    stop(StopReason::kStepLimit, front);
    status.measure = progress.rateAt(front);
    return false;
  }
  if (progress.areRefused()) {
    stop(StopReason::kToleranceTooSmall, front);
    return false;
  }
  const double expected = program.sinceFront(inputs.nextExpected());
  const double left =
      expected > 2.0 * resolutionOf(front) ? std::min(kLongestStep, expected) : kLongestStep;
  const Exchange& it = program.it;
  const bool was_still = program.isStill();
  const int method = it.choice.method;
  const scene_status made = program.step(left);
  statistics.rejected_steps += static_cast<std::uint64_t>(it.rejections);
  statistics.largest_error_estimate = std::max(statistics.largest_error_estimate, it.error);
  if (it.rounding > 1.0)
    statistics.largest_rounding = std::max(statistics.largest_rounding, it.rounding);
  forgetSample();
  if (made != SCENE_OK) {
    stop(made);
    return false;
  }
  statistics.mode_changes += events.note(it);
  ++statistics.steps;
  ++statistics.right_hand_sides;
  if (program.text().CHOOSES_METHOD != 0 && it.choice.method != method)
    ++statistics.stepper_switches;
  if (it.is_implicit != 0) ++statistics.implicit_steps;
  (program.text().IS_CLASSICAL != 0 ? statistics.newton_iterations : statistics.projections) +=
      static_cast<std::uint64_t>(it.corrections);
  if (it.passed >= 0 || it.is_event != 0) ++statistics.kinks;
  if (program.isStill() && !was_still) ++statistics.sleeps;
  noteEnergy();
  progress.noteRefusals(it.rejections);
  return true;
}

// --- commands --------------------------------------------------------------------------------

void Motion::settle() {
  if (!inputs.isAnyWaiting() || !status.ok()) return;
  if (is_start_) {
    inputs.begin();
    start();
  } else if (inputs.isAnyNew()) {  // otherwise the commands change nothing
    changeInputs();
  }
  inputs.clear();
}

bool Motion::cut() {
  if (!program.hasStep()) return true;
  const double at = program.insideStep(time);
  double through = 0.0;
  const double work = program.calcWork(at, &through);
  // (The modes at its end have not come.)
  if (at < program.it.event) statistics.mode_changes -= events.forgetLast();
  if (program.cut(at) != SCENE_OK) {
    stop(StopReason::kProjectionFailed, time);
    return false;
  }
  energy.endStep(time, work, through, program.it.state);
  return true;
}

void Motion::changeInputs() {
  if (!cut()) return;
  forgetSample();
  const bool jumps = inputs.change(time);
  const scene_status changed = program.change();
  if (jumps && changed == SCENE_OK) ++statistics.jumps;
  statistics.mode_changes += events.note(program.it);
  events.keepLast();
  if (changed != SCENE_OK) stop(changed);
}

// --- samples ---------------------------------------------------------------------------------

Sample& Motion::sample() {
  if (is_sample_valid_) return sample_;
  const scene_status seen = program.look(program.insideStep(time), &sample_);
  if (seen != SCENE_OK && status.ok()) {
    stop(seen);
    status.time = time;
  }
  sample_.time = time;
  is_sample_valid_ = true;
  if (is_energy_tracked) sample_.energy = calcEnergy();
  return sample_;
}

StateView Motion::view() {
  const Sample& now = sample();
  return program.view(time, now.angle, now.velocity, now.acceleration);
}

OperatingPoint Motion::operatingPoint() {
  settle();
  const StateView state = view();
  OperatingPoint point;
  point.time = time;
  point.angle.assign(state.angle, state.angle + scene.shaftCount());
  point.velocity.assign(state.velocity, state.velocity + scene.shaftCount());
  point.acceleration.assign(state.acceleration, state.acceleration + scene.shaftCount());
  point.input.assign(state.input, state.input + scene.inputCount());
  point.input_rate.assign(state.input_rate, state.input_rate + scene.inputCount());
  point.input_second_rate.assign(state.input_second_rate,
                                 state.input_second_rate + scene.inputCount());
  for (int i = 0; i < scene.inputCount(); ++i) point.command.push_back(inputs.signal(i).target());
  for (std::size_t h = 0; state.held != nullptr && h < scene.holdNames().size(); ++h) {
    point.mode.push_back(state.held[h].mode);
  }
  return point;
}

// --- energy ----------------------------------------------------------------------------------

void Motion::beginEnergy() {
  forgetSample();
  sample();
  energy.begin(program.kinetic());
  forgetSample();
}

Energy Motion::calcEnergy() {
  Sample& now = sample();
  double through = 0.0;
  const double applied =
      program.hasStep()
          ? energy.appliedBefore() + program.calcWork(program.insideStep(time), &through)
          : energy.account().applied;
  return energy.report(now, program.kinetic(), applied);
}

void Motion::noteEnergy() {
  const double made = program.it.made;
  const double* const state = program.it.state;
  double through = 0.0;
  const double work = program.calcWork(made, &through);
  if (energy.isWatched()) {
    if (!energy.hasDirections()) {
      program.writeRows(0.0, entries_.data());
      energy.noteDirections(entries_.data(), state);
    }
    program.writeRows(made, entries_.data());
  }
  energy.noteStep(program.front(), work, through, state, entries_.data());
}

}  // namespace variator_sim
