#include "integrate/integrator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "integrate/diagnosis.h"

namespace variator_sim {

Integrator::Integrator(PrincipleSystem& system, const Scene& scene)
    : S(system.shafts()),
      integrates_torque_(system.integratesTorque()),
      passed_(system),
      settings_(scene.solver),
      system_(system),
      drivetrain_(system.drivetrain()),
      choice_(system, scene.solver),
      stepper_(&choice_.stepper()),
      tolerance_{scene.solver.absolute_tolerance, scene.solver.relative_tolerance},
      checks_(system, tolerance_, choice_.isFixed()),
      jump_map_(system, scene.solver),
      control_(1),
      rest_(system),
      rows_(system),
      left_at_sleep_end_(system.size()),
      base_(system),
      front_(system),
      progress_(scene.solver.maximum_steps) {
  guards_.setGuards(
      drivetrain_.guards(),
      [this](double time, const double* angle, const double* velocity, const double* acceleration) {
        return drivetrain_.view(relative(time), angle, velocity, acceleration);
      },
      [this](const Interval& time, Interval* inputs) {
        drivetrain_.encloseInputs(relative(time.low), relative(time.high), inputs);
      });
  if (guards_.hasJumps()) system_.watch(&watch_);
  may_make_whole_steps_ = integrates_torque_ && guards_.isEmpty() && !choice_.isFixed();
}

void Integrator::reset() {
  status_ = MotionStatus{};
  statistics_ = Statistics{};
  is_start_ = true;
  progress_.begin(0.0);
  rhythm_.reset();
  choice_.forget();
  choice_.reset(starts_implicitly_);
  rows_.reset();
  checks_.reset();
  origin_.moveTo(0.0);
  drivetrain_.setOrigin(0.0);
  crossing_ = Crossing{};
  last_crossing_ = LastCrossing{};
  guards_.reset();
}

void Integrator::beginAt(const State& x) {
  front_ = StepNode(system_);
  front_.x = x;
  drivetrain_.resetCounts();
  restart();
  if (integrates_torque_ || !status_.ok()) return;
  // Once more, as the first time: accelerations that are iterated start from those of before.
  drivetrain_.resetCounts();
  restart();
}

void Integrator::beginFirstAt(const State& x) {
  base_ = front_ = StepNode(system_);
  base_.x = front_.x = x;
  choice_.reset();
  restart();
  if (!status_.ok()) return;
  starts_implicitly_ = choice_.isStiffStart(system_, front_, chooseFirstStep());
  // Once more, and as every later reset does: what was done to find out is no part of the run.
  drivetrain_.resetCounts();
  choice_.reset(starts_implicitly_);
  restart();
}

void Integrator::beginFrom(double time, const State& x, const double* epsilon,
                           const MotionState::History& history) {
  const Statistics counted = statistics_;
  reset();
  statistics_ = counted;
  progress_.begin(time);
  choice_.reset(history.is_implicit);
  origin_.moveTo(time);
  drivetrain_.setOrigin(time);
  drivetrain_.refreshInputs(0.0);
  front_ = StepNode(system_);
  front_.x = x;
  // What iterations start from, where the accelerations follow from the state.
  State slope(system_.size());
  std::copy_n(x.begin() + S, S, slope.begin());
  std::copy_n(epsilon, S, slope.begin() + S);
  system_.noteBase(0.0, x, slope);
  if (history.exists) {
    is_start_ = false;
    system_.keepReaction(history.kept_reaction);
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      rows_.remember(m, history.longest_row[m]);
    }
  }
  restart();
  if (is_start_ && status_.ok()) {
    choice_.reset(choice_.isStiffStart(system_, front_, chooseFirstStep()));
    restart();
  }
  is_start_ = false;
}

MotionState::History Integrator::history() const {
  MotionState::History history;
  history.exists = true;
  history.is_implicit = choice_.isImplicit();
  history.kept_reaction = system_.keptReaction();
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    history.longest_row[m] = rows_.reference(m);
  }
  return history;
}

void Integrator::beginNowhere(const State& x, const MotionStatus& status) {
  base_ = front_ = StepNode(system_);
  base_.x = front_.x = x;
  status_ = status;
}

void Integrator::cutAt(double time, const StepNode& node) {
  front_ = node;
  const double now = relative(time);
  drivetrain_.moveOrigin(now);
  drivetrain_.setOrigin(time);
  origin_.moveTo(time);
  front_.time = std::max(0.0, node.time - now);
  drivetrain_.refreshInputs(front_.time);
  base_ = front_;
}

void Integrator::moveOrigin(double t) {
  origin_.moveBy(t);
  drivetrain_.moveOrigin(t);
  drivetrain_.setOrigin(origin_.time());
}

void Integrator::restart() {
  course_ = Course::kStep;
  crossing_ = Crossing{};
  is_end_on_edge_ = false;
  rest_.reset();
  choice_.restart();
  stepper_ = &choice_.stepper();
  moveOrigin(front_.time);
  front_.time = 0.0;
  base_ = front_;
  drivetrain_.refreshInputs(front_.time);
  system_(front_.x, front_.dxdt, front_.time);
  if (!front_.dxdt.isFinite()) {
    explainStop();
    return;
  }
  noteDerivative();
  checks_.noteTorque(front_);
  checks_.noteAccelerations(front_);
  if (is_start_) system_.noteReaction(front_);
  noteRows();
  base_ = front_;
  if (!guards_.isEmpty()) {
    moveGuards();
    meetEdgeAtStart();
    if (is_start_ && !leaveCorner()) return;
  }
  control_.reset();
  restart_time_ = front_.time;
  fixed_steps_ = 0;
  if (choice_.isFixed()) return;
  next_step_ = 0.0;
  // (Whole steps find theirs.)
  if (!mayMakeWholeSteps() && !letStepperChoose()) next_step_ = chooseFirstStep();
}

bool Integrator::letStepperChoose() {
  const double limit = std::min(settings_.maximum_step, endOfReach() - base_.time);
  const double length = stepper_->chooseStep(system_, base_, limit);
  is_step_chosen_ = length > 0.0;
  if (is_step_chosen_) next_step_ = length;
  return is_step_chosen_;
}

double Integrator::chooseFirstStep() {
  const auto size = [&](const State& v) {
    double largest = 0.0;
    for (int i = 0; i < v.size(); ++i) {
      largest = std::max(largest, std::abs(v[i]) / tolerance_.of(front_.x[i]));
    }
    return largest;
  };
  const double d0 = size(front_.x);
  const double d1 = size(front_.dxdt);
  double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
  h0 = std::min(h0, settings_.maximum_step);
  State x1(system_.size());
  State change(system_.size());
  for (int i = 0; i < x1.size(); ++i) x1[i] = front_.x[i] + h0 * front_.dxdt[i];
  system_.noteBase(front_.time, front_.x, front_.dxdt);
  system_(x1, change, front_.time + h0);
  for (int i = 0; i < x1.size(); ++i) change[i] -= front_.dxdt[i];
  const double d2 = size(change) / h0;
  const double largest = std::max(d1, d2);
  // A step of the implicit schemes, whose order is high, is judged anyway, and a second step costs
  // more than one that is refused early. (What it errs along psi stays where stages do not keep
  // it.)
  const bool may_be_refused = stepper_->isImplicit() && system_.keepsConstraintsInStages();
  const double aim = may_be_refused ? 10.0 : 0.01;
  double h1 = largest <= 1e-15 ? std::max(1e-6, h0 * 1e-3)
                               : std::pow(aim / largest, 1.0 / stepper_->errorOrder());
  if (!std::isfinite(h1)) h1 = 1e-3 * h0;  // the Euler step left the domain
  // Without an absolute tolerance nothing that starts from 0 is ever slow enough: let it try.
  h1 = std::max(h1, 1e-6 * h0);
  return std::min({100.0 * h0, h1, settings_.maximum_step});
}

bool Integrator::haveInputsJumped(const double* u0) const {
  constexpr double kRounding = 1e-14;
  for (int i = 0; i < drivetrain_.inputCount(); ++i) {
    const double u1 = drivetrain_.inputs()[i];
    if (std::abs(u1 - u0[i]) > kRounding * (std::abs(u1) + std::abs(u0[i]))) return true;
  }
  return false;
}

bool Integrator::jump(const double* u0) {
  ++statistics_.jumps;
  drivetrain_.refreshInputs(front_.time);
  double u1[kMaxInputs];
  copyInputs(u1);
  const MotionStatus result =
      jump_map_.apply(front_.time, front_.x, u0, u1, &statistics_.projections);
  if (result.ok()) return true;
  status_ = result;
  status_.time = absolute(front_.time);
  return false;
}

bool Integrator::step(double target) {
  passed_.begin = passed_.end = nullptr;
  if (!countStep() || !finishInputSegments() || !makeStep(target)) {
    status_.time = absolute(front_.time);
    return false;
  }
  // A motion may come to rest on an edge that it crosses again and again.
  double rate = 0.0;
  if (course_ == Course::kHop && !choice_.isFixed()) lookForRest(&rate);
  // Steps of fixed size have had no need of it.
  if (!integrates_torque_ && choice_.isFixed()) checks_.noteTorque(front_);
  return true;
}

bool Integrator::countStep() {
  const double now = absolute(front_.time);
  if (!progress_.count(now)) {
    stop(StopReason::kStepLimit);
    status_.measure = progress_.rateAt(now);
    return false;
  }
  if (!progress_.isStuck(now, front_.time - base_.time)) return true;
  // Steps that get nowhere beside a jump go to and fro across it within its rounding.
  const int guard = nearJump();
  if (guard < 0) return true;
  stopChattering(guard);
  return false;
}

bool Integrator::finishInputSegments() {
  // Two inputs, or an input and a command, may be meant for one instant and be a rounding apart:
  // no step is so short.
  const double reached = front_.time + shortestStep(front_.time);
  if (drivetrain_.inputSegmentEnd() <= reached) {
    double u0[kMaxInputs];
    drivetrain_.evaluateInputs(front_.time);  // a sample may have been taken elsewhere
    copyInputs(u0);
    drivetrain_.finishInputSegments(front_.time, reached);
    if (haveInputsJumped(u0) && !jump(u0)) return false;
    if (std::exchange(is_end_on_edge_, false) && !jumpFrom(front_.torque.data())) return false;
    restart();
    if (!status_.ok()) return false;
  }
  return true;
}

bool Integrator::rests() const {
  if (drivetrain_.readsTime() || !settings_.sleep || choice_.isFixed()) return false;
  // Angles that nothing reads go on at constant speed.
  return std::all_of(front_.dxdt.begin() + (system_.readsAngles() ? 0 : S), front_.dxdt.end(),
                     [](double rate) { return rate == 0.0; });
}

bool Integrator::makeStep(double target) {
  // Before a long step: a controller's machine is to be seen at rest at once.
  if (base_.time == front_.time && rests() && fallAsleep()) {
    ++statistics_.sleeps;
    return true;
  }
  base_ = front_;
  system_.noteBase(base_.time, base_.x, base_.dxdt);
  stepper_ = &choice_.stepper();
  if (makeWholeStep(target)) return status_.ok();
  const bool is_behind_edge = course_ == Course::kHop;
  const bool is_due = crossing_.isDueAt(base_.time);
  course_ = is_due && crossEdge() ? Course::kHop : Course::kStep;
  if (course_ == Course::kHop) return true;
  if (!status_.ok()) return false;
  forgetCrossing(is_due);
  // The step before the edge says nothing about this branch. An implicit one that is much too
  // long for a swing or for something that grows damps it without its estimate showing anything.
  if (is_behind_edge && stepper_->isImplicit()) {
    const double first = std::max(chooseFirstStep(), kLeastRestart * next_step_);
    next_step_ = std::min(next_step_, first);
  }
  if (!choice_.isFixed() && !letStepperChoose() && choice_.leaveSeries()) {
    stepper_ = &choice_.stepper();
    followChoice();
    if (next_step_ == 0.0) next_step_ = chooseFirstStep();
  }
  return makeTrials();
}

void Integrator::stop(StopReason reason) {
  status_.reason = reason;
  status_.time = absolute(front_.time);
}

void Integrator::stopChattering(int guard) {
  stop(StopReason::kChattering);
  status_.guard = guard;
  status_.torque = drivetrain_.guardOwner(guard).torque;
  status_.constraint = drivetrain_.guardOwner(guard).constraint;
}

void Integrator::explainStop(StopReason otherwise) {
  stop(otherwise);
  diagnoseStop(system_, front_, rows_, &status_);
}

void Integrator::stopAtBadValue(double time, double t, const State& x) {
  status_.reason = StopReason::kNonFiniteValue;
  status_.time = time;
  nameBadValue(system_, t, x, &status_);
}

bool Integrator::stopWhereToleranceIsLost() {
  const double measure = checks_.unattainable();
  if (measure > 1.0) {
    statistics_.largest_rounding = std::max(statistics_.largest_rounding, measure);
  }
  // A branch that rounding flips is no accuracy that is lost.
  if (checks_.steepestTorque() < 0 || nearJump() >= 0) return false;
  front_ = base_;
  explainStop(StopReason::kToleranceTooSmall);
  if (status_.reason == StopReason::kToleranceTooSmall) {
    status_.measure = measure;
    status_.torque = checks_.steepestTorque();
  }
  return true;
}

bool Integrator::lookForRest(double* rate) {
  *rate = 0.0;
  if (drivetrain_.readsTime() || !settings_.sleep) return false;
  // Angles that nothing reads go on at constant speed.
  double change = 0.0;
  for (int n = system_.readsAngles() ? 0 : S; n < front_.x.size(); ++n) {
    const double allowed = tolerance_.of(front_.x[n]);
    *rate = std::max(*rate, std::abs(front_.dxdt[n]) / allowed);
    change = std::max(change, std::abs(front_.x[n] - base_.x[n]) / allowed);
  }
  if ((*rate != 0.0 && !rest_.noteStep(change)) || !fallAsleep()) return false;
  ++statistics_.sleeps;
  return true;
}

void Integrator::lookAhead() {
  if (stepper_->isImplicit()) ++statistics_.implicit_steps;
  double rate = 0.0;
  if (lookForRest(&rate)) return;
  if (!drivetrain_.readsTime() && settings_.sleep &&
      choice_.settle(front_, rate * (front_.time - base_.time))) {
    followChoice();
    return;
  }
  if (!choice_.isAutomatic()) return;
  const double limit =
      std::min(settings_.maximum_step, drivetrain_.inputSegmentEnd() - front_.time);
  if (choice_.reconsider(system_, front_, limit, &next_step_)) followChoice();
}

void Integrator::followChoice() {
  control_.reset();
}

bool Integrator::fallAsleep() {
  const double term =
      rest_.calcTerm(front_.time, front_.x, front_.dxdt, tolerance_, left_at_sleep_end_);
  const bool sleeps =
      term >= std::min(kLeastSleep * settings_.maximum_step, 0.25 * rest_.longestTerm());
  if (sleeps) course_ = Course::kRest;
  sleep_end_ = front_.time + term;
  return sleeps;
}

bool Integrator::finishSleep() {
  if (!countStep()) return false;  // terms may be as short as steps
  State x(system_.size());
  calcRest(sleep_end_, x);
  front_.time = sleep_end_;
  front_.x = x;
  for (int n = 0; n < x.size(); ++n) x[n] += left_at_sleep_end_[n];
  State moved(system_.size());
  const ProjectionResult projected =
      system_.project(front_.time, x, moved, &statistics_.projections);
  if (projected == ProjectionResult::kConverged) front_.x = x;
  restart();
  if (status_.ok()) fallAsleep();
  return status_.ok();
}

void Integrator::calcRest(double time, State& x) const {
  x = front_.x;
  if (system_.readsAngles()) return;
  for (int n = 0; n < S; ++n) x[n] += (time - front_.time) * front_.x[S + n];
}

}  // namespace variator_sim
