#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/motion_series.h"
#include "integrate/integrator.h"
#include "variator_sim/interruption.h"

namespace variator_sim {

Integrator::Trial Integrator::firstTrial() {
  Trial trial;
  trial.segment_end = endOfReach();
  trial.length = std::min(next_step_, settings_.maximum_step);
  if (choice_.isFixed()) {
    // Multiples of the step, not sums of it: no rounding piles up.
    // (A step across an edge may have gone a little beyond the next one.)
    do {
      trial.grid = restart_time_ + static_cast<double>(++fixed_steps_) * settings_.step;
    } while (!(trial.grid > base_.time));
    --fixed_steps_;
    trial.segment_end = std::min(trial.grid, trial.segment_end);
    trial.length = trial.segment_end - base_.time;
  }
  return trial;
}

bool Integrator::aim(Trial& trial) {
  // Up to the end of an input's segment at the most, and not leaving a sliver before it.
  const double reach = trial.looks > 0 ? trial.length : 1.01 * trial.length;
  trial.is_last = base_.time + reach >= trial.segment_end;
  trial.end = trial.is_last ? trial.segment_end : base_.time + trial.length;
  const bool is_fixed = choice_.isFixed();
  trial.taken = trial.is_last || is_fixed ? trial.end - base_.time : trial.length;
  if (trial.taken > (is_fixed ? 0.0 : std::max(shortestStep(base_.time), 1e-290))) return true;
  if (!hopOverJumpAhead() && status_.ok()) {
    explainStop(trial.has_leapt ? StopReason::kProjectionFailed : StopReason::kStepUnderflow);
    const int guard = status_.reason == StopReason::kStepUnderflow ? nearJump() : -1;
    if (guard >= 0) stopChattering(guard);
  }
  return false;
}

bool Integrator::makeTrials() {
  Trial trial = firstTrial();
  while (aim(trial)) {
    if (trial.looks + trial.rejections > 0 && Interruption::isWanted()) return false;
    watch_.begin();
    double norm = attempt(trial);
    const bool stages_left = watch_.end();
    if (!status_.ok()) return false;
    const bool is_blind = last_crossing_.false_guesses > kMostFalseGuesses && !isGood(norm) &&
                          trial.rejections < kHardPressed;
    if (!guards_.isEmpty() && std::isfinite(norm) && trial.looks < kMostLooks && !is_blind) {
      // An edge may be the reason for an error that is too large.
      const Look look = isGood(norm) ? lookInside(trial.taken, &trial.length)
                                     : lookAtEnd(trial.taken, &trial.length);
      if (look == Look::kCrossed) return true;
      if (!status_.ok()) return false;
      if (look == Look::kShorter) {
        if (!stepper_->isImplicit() || isEdgeOfTime(trial.taken)) {
          trial.usual = std::max(trial.usual, trial.taken);
        }
        ++trial.looks;
        ++statistics_.rejected_steps;
        front_ = base_;
        continue;
      }
      // A torque that jumps was met by the stages and not by the motion: too long a step.
      const bool counts = stages_left && !is_still_;
      if (counts && !choice_.isFixed() && norm <= 1.0) norm = kStagesLeft;
    }
    if (isGood(norm) && trial.rejections >= kHopeless && haveAccelerationsLeapt()) {
      trial.has_leapt = true;
      norm = std::numeric_limits<double>::quiet_NaN();
    }
    const bool may_halve =
        trial.unresolved < kMostUnresolved && trial.taken > Progress::leastAt(absolute(base_.time));
    if (isGood(norm) && may_halve && !isResolved(trial.taken)) {
      ++trial.unresolved;
      ++statistics_.rejected_steps;
      trial.length = 0.5 * trial.taken;
      front_ = base_;
      continue;
    }
    if (isGood(norm)) {
      if (accept(trial, norm)) return true;
      if (!status_.ok()) return false;
      norm = std::numeric_limits<double>::quiet_NaN();
    }
    if (!refuse(trial, norm)) break;
  }
  return course_ == Course::kHop;
}

bool Integrator::haveAccelerationsLeapt() const {
  // A psi that is linear in them has one branch only.
  const bool has_branches = drivetrain_.nonlinearAccelerations() != 0;
  if (integrates_torque_ || !has_branches || choice_.isFixed()) return false;
  constexpr double kLeap = 1e-5;
  const double part = std::max(kLeap, 10.0 * settings_.relative_tolerance);
  for (int n = S; n < 2 * S; ++n) {
    const double change = std::abs(front_.dxdt[n] - base_.dxdt[n]);
    if (!(change <= part * (1.0 + std::abs(base_.dxdt[n])))) return true;
  }
  return false;
}

double Integrator::stepAndProject(Stepper& stepper, const StepNode& from, double end, double h,
                                  State& x) {
  const double norm = stepper.step(system_, from, h, x);
  if (!isGood(norm)) return norm;
  return worseOf(norm, projectEnd(stepper, from.x, end, h, norm, x));
}

bool Integrator::isResolved(double taken) {
  MotionSeries* const series = system_.formulas();
  if (series == nullptr || choice_.isFixed() || stepper_->stepsBySeries()) return true;
  // phi, omega, epsilon
  double x[3][3 * kMaxShafts];
  const auto copy = [&](const State& from, const double* epsilon, double* to) {
    std::copy(from.begin(), from.end(), to);
    if (!integrates_torque_) std::copy_n(epsilon, S, to + 2 * S);
  };
  copy(base_.x, base_.dxdt.data() + S, x[0]);
  copy(front_.x, front_.dxdt.data() + S, x[2]);
  if (!series->mayHideAlong(base_.time, taken, x[0], x[2])) return true;
  State middle(system_.size());
  double epsilon[kMaxShafts];
  if (!stepper_->interpolate(system_, base_.time + 0.5 * taken, base_, front_, middle)) {
    for (int n = 0; n < middle.size(); ++n) {
      const double bend = base_.dxdt[n] - front_.dxdt[n];
      middle[n] = 0.5 * (base_.x[n] + front_.x[n]) + 0.125 * taken * bend;
    }
  }
  for (int i = 0; i < S; ++i) epsilon[i] = 0.5 * (x[0][2 * S + i] + x[2][2 * S + i]);
  copy(middle, epsilon, x[1]);
  return series->isStepResolved(base_.time, taken, x[0], x[1], x[2], tolerance_.absolute,
                                tolerance_.relative);
}

double Integrator::attempt(const Trial& trial) {
  double norm = stepAndProject(*stepper_, base_, trial.end, trial.taken, front_.x);
  control_.setScheme(std::max(1, stepper_->errorOrder()), !stepper_->isImplicit());
  // These decide whether the step is good. They may keep the next one from growing, but not make
  // it shorter: what rounding leaves in them does not fall with the step.
  front_.time = trial.end;
  own_norm_ = norm;
  if (isGood(norm)) norm = worseOfCheck(norm, checks_.checkTorque(*stepper_, base_, front_));
  // Just before a jump of the torque what lies beside the end may lie behind it.
  const bool is_before_jump =
      crossing_.isDueAt(front_.time) && guards_.guard(crossing_.guard).jumps();
  if (isGood(norm) && !is_before_jump) {
    norm = worseOfCheck(norm, checks_.checkAccelerations(*stepper_, base_, front_.time, front_.x));
    if (!choice_.isFixed() && stopWhereToleranceIsLost()) return norm;
  }
  if (isGood(norm) && !differentiateFront()) norm = std::numeric_limits<double>::quiet_NaN();
  // Where an input's closed form ends, its rate may be that behind the end.
  const bool ends_input =
      drivetrain_.inputSegmentEnd() <= front_.time + shortestStep(absolute(front_.time));
  if (isGood(norm) && !choice_.isFixed() && !ends_input) {
    const double estimate = stepper_->estimateFromEnd(base_, front_);
    own_norm_ = worseOf(own_norm_, estimate);
    norm = worseOf(norm, estimate);
  }
  return norm;
}

bool Integrator::accept(const Trial& trial, double norm) {
  ++statistics_.steps;
  if (choice_.isFixed()) {
    if (trial.end == trial.grid) ++fixed_steps_;
  } else {
    chooseNextStep(trial, norm);
  }
  if (!finishStep()) return false;
  if (!guards_.isEmpty()) moveGuards();
  if (choice_.isFixed()) return isFixedStepFine(norm);
  lookAhead();
  return true;
}

void Integrator::chooseNextStep(const Trial& trial, double norm) {
  // Who knows the next step beforehand needs no guess of it.
  double factor = 1.0;
  if (!is_step_chosen_) {
    const double ease = stepper_->ease();
    // Where a check holds it, it stays as long as the estimate alone would let it be.
    const double least =
        own_norm_ < norm ? std::min(1.0, ease * control_.growthBy(own_norm_)) : 0.0;
    const double growth = control_.growth(norm);
    factor = std::max(least, ease * growth);
    // What Newton's iteration leaves in the estimate does not fall with the step, either.
    if (ease > kEasy) factor = std::max(factor, std::min(1.0, growth));
  }
  if (trial.rejections > 0) factor = std::min(1.0, factor);
  // A step cut short by a segment's end or an edge says nothing about the next one's size.
  next_step_ = trial.is_last ? std::max(trial.length, trial.taken * factor) : trial.taken * factor;
  crossing_.otherwise = next_step_;
  if (trial.usual > trial.taken) next_step_ = std::max(next_step_, trial.usual);
}

bool Integrator::isFixedStepFine(double norm) {
  const double estimate = worseOf(norm, stepper_->estimateFromEnd(base_, front_));
  statistics_.largest_error_estimate = std::max(statistics_.largest_error_estimate, estimate);
  // The tolerance is no bound for steps of fixed size; but a step whose error is a part of the
  // state itself describes nothing any more.
  const double part = estimate * settings_.relative_tolerance;
  if (part <= kCrudest) return true;  // not when NaN
  front_ = base_;
  stop(StopReason::kStepTooLarge);
  status_.measure = part;
  return false;
}

bool Integrator::refuse(Trial& trial, double norm) {
  front_ = base_;
  crossing_ = Crossing{};
  if (choice_.isFixed()) {
    explainStop();
    return false;
  }
  ++statistics_.rejected_steps;
  trial.length = trial.taken * control_.shrink(norm);
  // Where no step however short succeeds, it may be for a jump just ahead that they all feel (a
  // Jacobian by differences, a stage).
  const bool is_hard_pressed = trial.rejections % kHardPressed == kHardPressed - 1;
  if (is_hard_pressed && (hopOverJumpAhead() || !status_.ok())) return false;
  if (++trial.rejections == kHopeless && choice_.giveUp()) {
    stepper_ = &choice_.stepper();
    followChoice();
  }
  return true;
}

bool Integrator::hopOverJumpAhead() {
  if (!guards_.hasJumps() || !crossJumpAhead(kAhead * settings_.maximum_step)) return false;
  course_ = Course::kHop;
  return true;
}

double Integrator::endOfReach() const {
  const double now = absolute(base_.time);
  const double instant = drivetrain_.nextInstant(now + 2.0 * shortestStep(now));
  const double segment_end = std::min(drivetrain_.inputSegmentEnd(), relative(instant));
  const double expected = rhythm_.next();
  const double rounding = shortestStep(expected);  // not more than this lies between equals
  const bool is_ahead = expected - now > rounding;
  return is_ahead && relative(expected) <= segment_end + rounding ? relative(expected)
                                                                  : segment_end;
}

double Integrator::projectEnd(const Stepper& stepper, const State& x_old, double end, double h,
                              double estimate, State& x) {
  if (!x.isFinite()) return std::numeric_limits<double>::quiet_NaN();
  if (drivetrain_.constraintCount() == 0) return 0.0;
  State moved(x.size());
  const ProjectionResult result =
      stepper.isImplicit()
          ? projectStiffly(system_, stepper, end, h, x, moved, &statistics_.projections)
          : system_.project(end, x, moved, &statistics_.projections);
  if (result != ProjectionResult::kConverged) return std::numeric_limits<double>::quiet_NaN();
  // Stages that hold psi = 0 themselves leave rounding to the projection, no error.
  if (stepper.isImplicit() && system_.keepsConstraintsInStages()) return 0.0;
  const double norm = calcErrorNorm(moved, x_old, x, tolerance_);
  if (norm <= kSteady || norm <= estimate) return norm;
  return discountRounding(end, x_old, x, moved);
}

double Integrator::discountRounding(double end, const State& x_old, const State& x,
                                    const State& moved) {
  State rounding(x.size());
  const double largest = calcRounding(end, x, rounding);
  State left = moved;
  for (int n = 0; n < x.size(); ++n) left[n] = std::max(0.0, moved[n] - rounding[n]);
  const double norm = calcErrorNorm(left, x_old, x, tolerance_);
  if (norm <= 1.0) noteRounding(largest);
  return norm;
}

double Integrator::calcRounding(double end, const State& x, State& rounding) {
  double velocity[kMaxShafts];
  double acceleration[kMaxShafts];
  drivetrain_.calcProjectionRounding(system_.view(end, x), velocity, acceleration);
  system_.addReactionRounding(end, x, acceleration);
  double largest = 0.0;
  const auto note = [&](int n, double size) {
    rounding[n] = size;
    largest = std::max(largest, size / tolerance_.of(x[n]));
  };
  for (int i = 0; i < S; ++i) {
    note(S + i, velocity[i]);
    if (integrates_torque_) note(x.size() - S + i, acceleration[i]);
  }
  return largest;
}

void Integrator::noteRounding(double largest) {
  if (largest > 1.0) {
    statistics_.largest_rounding = std::max(statistics_.largest_rounding, largest);
  }
}

bool Integrator::differentiateFront() {
  system_.restoreReaction(front_, kLittle);
  system_(front_.x, front_.dxdt, front_.time);
  noteDerivative();
  return front_.dxdt.isFinite();
}

void Integrator::noteDerivative() {
  checks_.noteTorqueRate(front_);
  rows_.look();
  is_in_corner_ = system_.isInCorner();
}

bool Integrator::finishStep() {
  checks_.noteAccelerations(front_);
  if (!checks_.isTorqueFollowed(*stepper_, base_, front_)) return false;
  return noteRows();
}

bool Integrator::noteRows() {
  const RowWatch::Verdict verdict = rows_.note(base_.time == front_.time);
  if (verdict == RowWatch::Verdict::kVanished) {
    stop(StopReason::kSingularConstraint);
    status_.constraint = rows_.vanished();
    status_.measure = rows_.measure();
  }
  return verdict == RowWatch::Verdict::kGood;
}

}  // namespace variator_sim
