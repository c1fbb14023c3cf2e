#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "motion.h"

namespace variator_sim {

bool Motion::step() {
  // Two inputs, or an input and a command, may be meant for one instant and be a rounding apart:
  // no step is so short.
  const double reached = front_.time + shortestStep(front_.time);
  if (drivetrain_.inputSegmentEnd() <= reached) {
    double u0[kMaxInputs];
    drivetrain_.evaluateInputs(front_.time);  // a sample may have been taken elsewhere
    copyInputs(u0);
    drivetrain_.finishInputSegments(front_.time, reached);
    if (haveInputsJumped(u0) && !jump(u0)) return false;
    restart();
    if (!status_.ok()) return false;
  }
  base_ = front_;
  system_.noteBase(base_.time, base_.x, base_.dxdt);
  stepper_ = &choice_.stepper();
  const bool is_behind_edge = hopped_;
  const bool is_due = crossing_.isDueAt(base_.time);
  hopped_ = is_due && crossEdge();
  if (hopped_) return true;
  if (!status_.ok()) return false;
  if (is_due) next_step_ = std::min(next_step_, crossing_.otherwise);
  crossing_ = Crossing{};
  // The step before the edge says nothing about this branch. An implicit one that is much too
  // long for a swing or for something that grows damps it without its estimate showing anything.
  if (is_behind_edge && !choice_.isFixed() && stepper_->isImplicit()) {
    const double first = std::max(chooseFirstStep(), kLeastRestart * next_step_);
    next_step_ = std::min(next_step_, first);
  }
  return choice_.isFixed() ? stepFixed() : stepAdaptively();
}

bool Motion::stepAdaptively() {
  const SolverSettings& solver = scene_.solver;
  const double segment_end = endOfReach();
  bool rejected = false;
  int rejections = 0;
  int looks = 0;
  double h = std::min(next_step_, solver.maximum_step);
  double usual = 0.0;  // the step that would have been made but for an edge
  while (true) {
    // Up to the end of an input's segment at the most, and not leaving a sliver before it.
    const double reach = looks > 0 ? h : 1.01 * h;
    const bool last_of_segment = base_.time + reach >= segment_end;
    const double end = last_of_segment ? segment_end : base_.time + h;
    const double taken = last_of_segment ? segment_end - base_.time : h;
    if (!(taken > shortestStep(base_.time)) || !(taken > 1e-290)) {
      hopped_ = guards_.hasJumps() && crossJumpAhead(kAhead * solver.maximum_step);
      if (!hopped_ && status_.ok()) explainStop();
      return hopped_;
    }
    watch_.begin();
    double norm = stepper_->step(system_, base_, taken, front_.x, dxdt_new_);
    const bool stages_left = watch_.end();
    if (norm <= 1.0)
      norm = worseOf(norm, projectEnd(*stepper_, base_.x, end, taken, norm, front_.x));
    // These decide whether the step is good. They may keep the next one from growing, but not
    // make it shorter: what rounding leaves in them does not fall with the step.
    front_.time = end;
    if (norm <= 1.0) norm = worseOfCheck(norm, checks_.checkTorque(*stepper_, base_, front_));
    if (norm <= 1.0) {
      norm = worseOfCheck(norm, checkAccelerations());
      if (stopWhereToleranceIsLost()) return false;
    }
    if (norm <= 1.0 && !differentiateFront()) norm = std::numeric_limits<double>::quiet_NaN();
    if (!guards_.isEmpty() && std::isfinite(norm) && looks < kMostLooks) {
      // An edge may be the reason for an error that is too large.
      const Look look = norm <= 1.0 ? lookInside(taken, &h) : lookAtEnd(taken, &h);
      if (look == Look::kCrossed) return true;
      if (!status_.ok()) return false;
      if (look == Look::kShorter) {
        usual = std::max(usual, taken);
        ++looks;
        ++statistics_.rejected_steps;
        front_ = base_;
        continue;
      }
      // A torque that jumps was met by the stages and not by the motion: too long a step.
      if (stages_left && norm <= 1.0) norm = kStagesLeft;
    }
    if (norm <= 1.0) {
      ++statistics_.steps;
      double factor = control_.growth(norm);
      if (rejected) factor = std::min(1.0, factor);
      // A step cut short by a segment's end or an edge says nothing about the next one's size.
      next_step_ = last_of_segment ? std::max(h, taken * factor) : taken * factor;
      crossing_.otherwise = next_step_;
      // (What an implicit step thinks of its error when it is much too long is no guide; where
      // the torque is integrated, its change is compared.)
      const bool is_trusted = integrates_torque_ || !stepper_->isImplicit();
      if (usual > taken && is_trusted) next_step_ = std::max(next_step_, usual);
      if (finishStep()) {
        if (!guards_.isEmpty()) moveGuards();
        lookAhead();
        return true;
      }
      if (!status_.ok()) return false;
      norm = std::numeric_limits<double>::quiet_NaN();
    }
    ++statistics_.rejected_steps;
    rejected = true;
    h = taken * control_.shrink(norm);
    front_ = base_;
    crossing_ = Crossing{};
    // Where no step however short succeeds, it may be for a jump just ahead that they all feel
    // (a Jacobian by differences, a stage).
    if (rejections % kHardPressed == kHardPressed - 1 && guards_.hasJumps()) {
      hopped_ = crossJumpAhead(kAhead * solver.maximum_step);
      if (hopped_ || !status_.ok()) return hopped_;
    }
    if (++rejections == kHopeless && choice_.giveUpExplicit()) {
      stepper_ = &choice_.stepper();
      control_.setOrder(stepper_->errorOrder());
      control_.reset();
    }
  }
}

bool Motion::stepFixed() {
  // Multiples of the step, not sums of it: no rounding piles up.
  // (A step across an edge may have gone a little beyond the next one.)
  double grid = base_.time;
  while (!(grid > base_.time)) {
    grid = restart_time_ + static_cast<double>(++fixed_steps_) * scene_.solver.step;
  }
  --fixed_steps_;
  double end = std::min(grid, endOfReach());
  for (int looks = 0;; ++looks) {
    if (!(end > base_.time)) {
      stop(StopReason::kStepUnderflow);
      return false;
    }
    const double taken = end - base_.time;
    const double norm = stepper_->step(system_, base_, taken, front_.x, dxdt_new_);
    const double moved = projectEnd(*stepper_, base_.x, end, taken, norm, front_.x);
    if (!std::isfinite(norm) || !std::isfinite(moved)) {
      front_ = base_;
      explainStop();
      return false;
    }
    front_.time = end;
    const double unaccounted =
        worseOf(checks_.checkTorque(*stepper_, base_, front_), checkAccelerations());
    const bool differentiated = differentiateFront();
    if (differentiated && !guards_.isEmpty() && looks < kMostLooks) {
      double shorter = taken;
      const Look look = lookInside(taken, &shorter);
      if (look == Look::kCrossed) return true;
      if (!status_.ok()) return false;
      if (look == Look::kShorter) {
        end = base_.time + shorter;
        front_ = base_;
        continue;
      }
    }
    if (end == grid) ++fixed_steps_;
    ++statistics_.steps;
    if (!differentiated || !finishStep()) {
      if (status_.ok()) {
        front_ = base_;
        explainStop();
      }
      return false;
    }
    if (!guards_.isEmpty()) moveGuards();
    const double estimate = worseOf(worseOf(norm, moved),
                                    worseOf(unaccounted, stepper_->estimateFromEnd(base_, front_)));
    statistics_.largest_error_estimate = std::max(statistics_.largest_error_estimate, estimate);
    // The tolerance is no bound for steps of fixed size; but a step whose error is a part of the
    // state itself describes nothing any more.
    const double part = estimate * scene_.solver.relative_tolerance;
    if (part <= kCrudest) return true;  // not when NaN
    front_ = base_;
    stop(StopReason::kStepTooLarge);
    status_.measure = part;
    return false;
  }
}

double Motion::endOfReach() const {
  const double now = absolute(base_.time);
  const double instant = drivetrain_.nextInstant(now + 2.0 * shortestStep(now));
  const double segment_end = std::min(drivetrain_.inputSegmentEnd(), relative(instant));
  const double expected = rhythm_.next();
  const double rounding = shortestStep(expected);  // not more than this lies between equals
  const bool is_ahead = expected - now > rounding;
  return is_ahead && relative(expected) <= segment_end + rounding ? relative(expected)
                                                                  : segment_end;
}

bool Motion::reachPresent(StepNode* node) {
  const double now = present();
  if (sleeping_) {
    node->time = now;
    calcRest(now, node->x);
    return true;
  }
  Stepper& stepper = choice_.innerOf(*stepper_);
  *node = base_;
  if (hopped_) {
    node->time = now;
    node->x = goAhead(base_, now - base_.time);
    return true;
  }
  double h = now - base_.time;
  int steps = 0;
  while (now - node->time > shortestStep(now)) {
    if (++steps > scene_.solver.maximum_steps) {
      stop(StopReason::kStepLimit);
      status_.time = time_ = absolute(node->time);
      return false;
    }
    const bool last = node->time + h >= now;
    const double end = last ? now : node->time + h;
    const StepNode start = *node;
    if (!(end > start.time)) {
      base_ = front_ = start;
      explainStop();
      time_ = absolute(start.time);
      return false;
    }
    double norm = stepper.step(system_, start, end - start.time, node->x, node->dxdt);
    if (norm <= 1.0 || (choice_.isFixed() && std::isfinite(norm))) {
      const double moved = projectEnd(stepper, start.x, end, end - start.time, norm, node->x);
      norm = worseOf(norm, moved);
    }
    if (norm <= 1.0) {
      const State* dxdt = stepper.projects() ? &node->dxdt : nullptr;
      norm = worseOf(norm, checks_.checkAccelerations(stepper, start, end, node->x, dxdt));
    }
    if (norm <= 1.0 || (choice_.isFixed() && std::isfinite(norm))) {
      node->time = end;
      if (!last && !stepper.projects()) system_(node->x, node->dxdt, end);
      h *= 2.0;
    } else {
      *node = start;
      h = 0.5 * (end - start.time);  // rare: a shorter step is nearly always better
    }
  }
  node->time = now;
  return true;
}

double Motion::projectEnd(const Stepper& stepper, const State& x_old, double end, double h,
                          double estimate, State& x) {
  if (!stepper.projects()) {
    for (double value : x) {
      if (!std::isfinite(value)) return std::numeric_limits<double>::quiet_NaN();
    }
  }
  if (drivetrain_.constraintCount() == 0) return 0.0;
  StepProjection own(system_.size());
  if (stepper.isImplicit()) {
    own.result = projectStiffly(system_, stepper, end, h, x, own);
  } else if (!stepper.projects()) {
    own.result = system_.project(end, x, own.moved, &own.iterations);
  }
  const StepProjection& projection = stepper.projects() ? stepper.projection() : own;
  statistics_.projections += projection.iterations;
  if (projection.result != ProjectionResult::kConverged) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  // Stages that hold psi = 0 themselves leave rounding to the projection, no error.
  if (stepper.keepsConstraints() && system_.keepsConstraintsInStages()) return 0.0;
  const double norm = calcErrorNorm(projection.moved, x_old, x, tolerance_);
  if (norm <= kSteady || norm <= estimate) return norm;
  return discountRounding(end, x_old, x, projection.moved);
}

double Motion::discountRounding(double end, const State& x_old, const State& x,
                                const State& moved) {
  double velocity[kMaxShafts];
  double acceleration[kMaxShafts];
  drivetrain_.calcProjectionRounding(system_.view(end, x), velocity, acceleration);
  State left = moved;
  double rounding = 0.0;
  const auto discount = [&](int n, double size) {
    left[n] = std::max(0.0, moved[n] - size);
    rounding = std::max(rounding, size / tolerance_.of(x[n]));
  };
  for (int i = 0; i < S; ++i) {
    discount(S + i, velocity[i]);
    if (integrates_torque_) discount(x.size() - S + i, acceleration[i]);
  }
  const double norm = calcErrorNorm(left, x_old, x, tolerance_);
  if (norm <= 1.0 && rounding > 1.0) {
    statistics_.largest_rounding = std::max(statistics_.largest_rounding, rounding);
  }
  return norm;
}

bool Motion::differentiateFront() {
  const bool moved = system_.restoreReaction(front_, kLittle);
  if (stepper_->projects() && !moved) {
    front_.dxdt = dxdt_new_;
  } else {
    system_(front_.x, front_.dxdt, front_.time);
  }
  for (double value : front_.dxdt) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

bool Motion::finishStep() {
  checks_.noteTorqueRate(front_);
  checks_.noteAccelerations(front_);
  if (!checks_.isTorqueFollowed(*stepper_, base_, front_)) return false;
  return noteRows();
}

double Motion::checkAccelerations() {
  // Just before a jump of the torque what lies beside the end may lie behind it.
  if (crossing_.isDueAt(front_.time) && guards_.guard(crossing_.guard).jumps()) return 0.0;
  const State* dxdt = stepper_->projects() ? &dxdt_new_ : nullptr;
  return checks_.checkAccelerations(*stepper_, base_, front_.time, front_.x, dxdt);
}

bool Motion::noteRows() {
  system_.noteColumns();
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    const double length_squared = system_.rowLengthSquared(m);
    row_reference_[m] = std::max(row_reference_[m], length_squared);
    if (length_squared <= kVanished * kVanished * row_reference_[m]) {
      stop(StopReason::kSingularConstraint);
      status_.constraint = m;
      status_.measure = std::sqrt(length_squared / row_reference_[m]);
      return false;
    }
  }
  return drivetrain_.hasConstantRows() || !haveRowsTurned();
}

bool Motion::haveRowsTurned() {
  double turned[kMaxShafts];
  const bool is_start = base_.time == front_.time || std::exchange(has_new_rows_, false);
  for (int m = 0; m < drivetrain_.constraintCount() && !is_start; ++m) {
    drivetrain_.inertia().solve(system_.row(m), turned);
    double product = 0.0;
    for (int i = 0; i < S; ++i) product += row_before_[m][i] * turned[i];
    if (!(product > 0.0)) return true;
  }
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    std::copy_n(system_.row(m), S, row_before_[m]);
  }
  return false;
}

void Motion::lookAhead() {
  if (stepper_->isImplicit()) ++statistics_.implicit_steps;
  if (!drivetrain_.readsTime() && scene_.solver.sleep) {
    // Angles that nothing reads go on at constant speed.
    double rate = 0.0;
    double change = 0.0;
    for (int n = system_.readsAngles() ? 0 : S; n < front_.x.size(); ++n) {
      const double allowed = tolerance_.of(front_.x[n]);
      rate = std::max(rate, std::abs(front_.dxdt[n]) / allowed);
      change = std::max(change, std::abs(front_.x[n] - base_.x[n]) / allowed);
    }
    if ((rate == 0.0 || rest_.noteStep(change)) && fallAsleep()) {
      ++statistics_.sleeps;
      return;
    }
    if (choice_.settle(front_, rate * (front_.time - base_.time))) {
      control_.setOrder(choice_.stepper().errorOrder());
      control_.reset();
      return;
    }
  }
  if (!choice_.isAutomatic()) return;
  const double limit =
      std::min(scene_.solver.maximum_step, drivetrain_.inputSegmentEnd() - front_.time);
  if (choice_.reconsider(system_, front_, limit, &next_step_)) {
    control_.setOrder(choice_.stepper().errorOrder());
    control_.reset();
  }
}

bool Motion::fallAsleep() {
  const double term =
      rest_.calcTerm(front_.time, front_.x, front_.dxdt, tolerance_, left_at_sleep_end_);
  sleeping_ = term >= kLeastSleep * scene_.solver.maximum_step;
  sleep_end_ = front_.time + term;
  return sleeping_;
}

bool Motion::finishSleep() {
  StepNode end = front_;
  end.time = sleep_end_;
  calcRest(sleep_end_, end.x);
  cutEnergy(end);
  front_.time = end.time;
  front_.x = end.x;
  State x = end.x;
  for (int n = 0; n < x.size(); ++n) x[n] += left_at_sleep_end_[n];
  State moved(system_.size());
  const ProjectionResult projected =
      system_.project(front_.time, x, moved, &statistics_.projections);
  if (projected == ProjectionResult::kConverged) front_.x = x;
  restart();
  if (status_.ok()) fallAsleep();
  return status_.ok();
}

void Motion::calcRest(double time, State& x) const {
  x = front_.x;
  if (system_.readsAngles()) return;
  for (int n = 0; n < S; ++n) x[n] += (time - front_.time) * front_.x[S + n];
}

}  // namespace variator_sim
