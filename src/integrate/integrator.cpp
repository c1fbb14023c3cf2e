#include "integrate/integrator.h"

#include <algorithm>
#include <cmath>

#include "motion/diagnosis.h"

namespace variator_sim {
namespace {

/// Whether an input is not what it was, beyond rounding.
bool haveInputsJumped(const Drivetrain& drivetrain, const double* u0) {
  constexpr double kRounding = 1e-14;
  for (int i = 0; i < drivetrain.inputCount(); ++i) {
    const double u1 = drivetrain.inputs()[i];
    if (std::abs(u1 - u0[i]) > kRounding * (std::abs(u1) + std::abs(u0[i]))) return true;
  }
  return false;
}

/// The guards of a system's laws.
GuardSearch makeGuards(CurrentStep& step) {
  GuardSearch guards;
  guards.setGuards(
      step.drivetrain.guards(),
      [&step](double time, const double* angle, const double* velocity,
              const double* acceleration) {
        return step.drivetrain.view(step.relative(time), angle, velocity, acceleration);
      },
      [&step](const Interval& time, Interval* inputs) {
        step.drivetrain.encloseInputs(step.relative(time.low), step.relative(time.high), inputs);
      });
  return guards;
}

}  // namespace

Integrator::Integrator(System& system, const Scene& scene)
    : step_(system, scene),
      guards_(makeGuards(step_)),
      crossing_(step_, scene, guards_),
      events_(step_, guards_, crossing_),
      size_(step_),
      trials_(step_, guards_, crossing_, events_, size_),
      inside_(step_, guards_) {}

void Integrator::reset() {
  step_.status = MotionStatus{};
  step_.statistics = Statistics{};
  step_.is_at_start = true;
  step_.progress.begin(0.0);
  size_.reset();
  step_.choice.forget();
  step_.choice.reset(starts_implicitly_);
  step_.rows.reset();
  step_.checks.reset();
  step_.origin.moveTo(0.0);
  step_.drivetrain.setOrigin(0.0);
  crossing_.reset();
}

void Integrator::beginAt(const State& x) {
  step_.end = StepNode(step_.system);
  step_.end.x = x;
  step_.drivetrain.resetCounts();
  restart();
  if (step_.integrates_torque || !step_.status.ok()) return;
  // Once more, as the first time: accelerations that are iterated start from those of before.
  step_.drivetrain.resetCounts();
  restart();
}

void Integrator::beginFirstAt(const State& x) {
  step_.start = step_.end = StepNode(step_.system);
  step_.start.x = step_.end.x = x;
  step_.choice.reset();
  restart();
  if (!step_.status.ok()) return;
  starts_implicitly_ = step_.choice.isStiffStart(step_.system, step_.end, size_.chooseFirst());
  // Once more, and as every later reset does: what was done to find out is no part of the run.
  step_.drivetrain.resetCounts();
  step_.choice.reset(starts_implicitly_);
  restart();
}

void Integrator::placeEnd(const State& x, const double* epsilon) {
  step_.drivetrain.setOrigin(step_.origin.time());
  step_.drivetrain.refreshInputs(0.0);
  step_.end = StepNode(step_.system);
  step_.end.x = x;
  // Iterations start from these where the accelerations follow from the state.
  State slope(step_.system.size());
  std::copy_n(x.begin() + step_.S, step_.S, slope.begin());
  std::copy_n(epsilon, step_.S, slope.begin() + step_.S);
  step_.system.noteBase(0.0, x, slope);
}

void Integrator::beginFrom(double time, const State& x, const double* epsilon,
                           const MotionState::History& history) {
  const Statistics counted = step_.statistics;
  reset();
  step_.statistics = counted;
  step_.progress.begin(time);
  step_.choice.reset(history.is_implicit);
  step_.origin.moveTo(time);
  placeEnd(x, epsilon);
  if (history.exists) {
    step_.is_at_start = false;
    step_.system.reaction().keep(history.kept_reaction);
    for (int m = 0; m < step_.drivetrain.constraintCount(); ++m) {
      step_.rows.remember(m, history.longest_row[m]);
    }
  }
  restart();
  if (step_.is_at_start && step_.status.ok()) {
    step_.choice.reset(step_.choice.isStiffStart(step_.system, step_.end, size_.chooseFirst()));
    restart();
  }
  step_.is_at_start = false;
}

MotionState::History Integrator::history() const {
  MotionState::History history;
  history.exists = true;
  history.is_implicit = step_.choice.isImplicit();
  history.kept_reaction = step_.system.reaction().kept();
  for (int m = 0; m < step_.drivetrain.constraintCount(); ++m) {
    history.longest_row[m] = step_.rows.reference(m);
  }
  return history;
}

void Integrator::beginNowhere(const State& x, const MotionStatus& status) {
  step_.start = step_.end = StepNode(step_.system);
  step_.start.x = step_.end.x = x;
  step_.status = status;
}

void Integrator::cutAt(double time, const StepNode& node) {
  step_.end = node;
  const double now = step_.relative(time);
  step_.drivetrain.moveOrigin(now);
  step_.drivetrain.setOrigin(time);
  step_.origin.moveTo(time);
  step_.end.time = std::max(0.0, node.time - now);
  step_.drivetrain.refreshInputs(step_.end.time);
  step_.start = step_.end;
}

void Integrator::moveOrigin(double t) {
  step_.origin.moveBy(t);
  step_.drivetrain.moveOrigin(t);
  step_.drivetrain.setOrigin(step_.origin.time());
}

void Integrator::restart() {
  step_.phase = StepPhase::kStepping;
  crossing_.restart();
  step_.choice.restart();
  step_.stepper = &step_.choice.stepper();
  moveOrigin(step_.end.time);
  step_.end.time = 0.0;
  step_.start = step_.end;
  step_.drivetrain.refreshInputs(step_.end.time);
  step_.system(step_.end.x, step_.end.dxdt, step_.end.time);
  if (!step_.end.dxdt.isFinite()) {
    step_.explainStop();
    return;
  }
  step_.noteDerivative();
  step_.checks.noteTorque(step_.end);
  step_.checks.noteAccelerations(step_.end);
  if (step_.is_at_start) step_.system.reaction().note(step_.end);
  step_.noteRows();
  step_.start = step_.end;
  if (!guards_.isEmpty() && !events_.begin()) return;
  size_.forgetErrors();
  trials_.restart();
  if (step_.choice.isFixed()) return;
  step_.next_length = 0.0;
  if (!size_.letStepperChoose()) step_.next_length = size_.chooseFirst();
}

bool Integrator::step() {
  if (!prepare() || !attempt()) {
    step_.status.time = step_.absolute(step_.end.time);
    return false;
  }
  conclude();
  return true;
}

bool Integrator::prepare() {
  return countStep() && finishInputSegments();
}

bool Integrator::countStep() {
  const double now = step_.absolute(step_.end.time);
  if (!step_.progress.count(now)) {
    step_.stop(StopReason::kStepLimit);
    step_.status.measure = step_.progress.rateAt(now);
    return false;
  }
  if (!step_.progress.isStuck(now, step_.end.time - step_.start.time)) return true;
  // Steps that get nowhere beside a jump go to and fro across it within its rounding.
  const int guard = crossing_.findJumpNear();
  if (guard < 0) return true;
  step_.stopChattering(guard);
  return false;
}

bool Integrator::finishInputSegments() {
  // Two inputs, or an input and a command, may be meant for one instant and be a rounding apart:
  // no step is so short.
  const double reached = step_.end.time + shortestStep(step_.end.time);
  if (step_.drivetrain.inputSegmentEnd() > reached) return true;
  double u0[kMaxInputs];
  step_.drivetrain.evaluateInputs(step_.end.time);  // a sample may have been taken elsewhere
  std::copy_n(step_.drivetrain.inputs(), step_.drivetrain.inputCount(), u0);
  step_.drivetrain.finishInputSegments(step_.end.time, reached);
  if (haveInputsJumped(step_.drivetrain, u0) && !crossing_.jumpInputs(u0)) return false;
  if (!crossing_.finishEnd()) return false;
  restart();
  return step_.status.ok();
}

bool Integrator::attempt() {
  step_.start = step_.end;
  step_.system.noteBase(step_.start.time, step_.start.x, step_.start.dxdt);
  step_.stepper = &step_.choice.stepper();
  const bool is_behind_event = step_.phase == StepPhase::kCrossing;
  if (crossDueEvent()) return true;
  if (!step_.status.ok()) return false;
  // The step before the event says nothing about this branch. An implicit one that is much too
  // long for a swing or for something that grows damps it without its estimate showing anything.
  if (is_behind_event && step_.stepper->isImplicit()) {
    // At least so much of the step before an event is tried behind it.
    constexpr double kLeastRestart = 1e-8;
    const double first = std::max(size_.chooseFirst(), kLeastRestart * step_.next_length);
    step_.next_length = std::min(step_.next_length, first);
  }
  if (!step_.choice.isFixed() && !size_.letStepperChoose() && step_.choice.leaveSeries()) {
    step_.stepper = &step_.choice.stepper();
    size_.forgetErrors();
    if (step_.next_length == 0.0) step_.next_length = size_.chooseFirst();
  }
  return trials_.make();
}

bool Integrator::crossDueEvent() {
  step_.phase = StepPhase::kStepping;
  const bool is_due = crossing_.next().isDueAt(step_.start.time);
  if (is_due && crossing_.cross()) return true;
  if (step_.status.ok()) crossing_.forgetNext(is_due);
  return false;
}

void Integrator::conclude() {
  if (step_.choice.isFixed()) {
    // Steps of fixed size have had no need of it.
    if (!step_.integrates_torque) step_.checks.noteTorque(step_.end);
    return;
  }
  if (step_.phase != StepPhase::kStepping) return;
  if (step_.stepper->isImplicit()) ++step_.statistics.implicit_steps;
  if (!step_.choice.isAutomatic()) return;
  const double limit =
      std::min(step_.settings.maximum_step, step_.drivetrain.inputSegmentEnd() - step_.end.time);
  if (step_.choice.reconsider(step_.system, step_.end, limit, &step_.next_length))
    size_.forgetErrors();
}

bool Integrator::finishEnd() {
  if (!crossing_.isEndOnEvent() || finishInputSegments()) return true;
  step_.status.time = step_.absolute(step_.end.time);
  return false;
}

void Integrator::stopAtBadValue(double time, double t, const State& x) {
  step_.status.reason = StopReason::kNonFiniteValue;
  step_.status.time = time;
  nameBadValue(step_.system, t, x, &step_.status);
}

void Integrator::exhaustTime(double time) {
  step_.status.reason = StopReason::kTimeExhausted;
  step_.status.time = time;
}

}  // namespace variator_sim
