#include <algorithm>
#include <cmath>
#include <limits>

#include "integrate/integrator.h"

namespace variator_sim {

bool Integrator::stepAdaptively() {
  Trial trial;
  trial.segment_end = endOfReach();
  trial.length = std::min(next_step_, settings_.maximum_step);
  while (true) {
    // Up to the end of an input's segment at the most, and not leaving a sliver before it.
    const double reach = trial.looks > 0 ? trial.length : 1.01 * trial.length;
    trial.is_last = base_.time + reach >= trial.segment_end;
    const double end = trial.is_last ? trial.segment_end : base_.time + trial.length;
    trial.taken = trial.is_last ? trial.segment_end - base_.time : trial.length;
    if (!(trial.taken > shortestStep(base_.time)) || !(trial.taken > 1e-290)) {
      hopped_ = guards_.hasJumps() && crossJumpAhead(kAhead * settings_.maximum_step);
      if (!hopped_ && status_.ok()) explainStop();
      return hopped_;
    }
    watch_.begin();
    double norm = attempt(end, trial.taken);
    const bool stages_left = watch_.end();
    if (!status_.ok()) return false;
    if (!guards_.isEmpty() && std::isfinite(norm) && trial.looks < kMostLooks) {
      // An edge may be the reason for an error that is too large.
      const Look look = norm <= 1.0 ? lookInside(trial.taken, &trial.length)
                                    : lookAtEnd(trial.taken, &trial.length);
      if (look == Look::kCrossed) return true;
      if (!status_.ok()) return false;
      if (look == Look::kShorter) {
        trial.usual = std::max(trial.usual, trial.taken);
        ++trial.looks;
        ++statistics_.rejected_steps;
        front_ = base_;
        continue;
      }
      // A torque that jumps was met by the stages and not by the motion: too long a step.
      if (stages_left && norm <= 1.0) norm = kStagesLeft;
    }
    if (norm <= 1.0) {
      if (accept(trial, norm)) return true;
      if (!status_.ok()) return false;
      norm = std::numeric_limits<double>::quiet_NaN();
    }
    if (!refuse(trial, norm)) return hopped_;
  }
}

double Integrator::attempt(double end, double taken) {
  double norm = stepper_->step(system_, base_, taken, front_.x, dxdt_new_);
  if (norm <= 1.0) {
    norm = worseOf(norm, projectEnd(*stepper_, base_.x, end, taken, norm, front_.x));
  }
  // These decide whether the step is good. They may keep the next one from growing, but not make
  // it shorter: what rounding leaves in them does not fall with the step.
  front_.time = end;
  if (norm <= 1.0) norm = worseOfCheck(norm, checks_.checkTorque(*stepper_, base_, front_));
  if (norm <= 1.0) {
    norm = worseOfCheck(norm, checkAccelerations());
    if (stopWhereToleranceIsLost()) return norm;
  }
  if (norm <= 1.0 && !differentiateFront()) norm = std::numeric_limits<double>::quiet_NaN();
  return norm;
}

bool Integrator::accept(const Trial& trial, double norm) {
  ++statistics_.steps;
  double factor = control_.growth(norm);
  if (trial.rejections > 0) factor = std::min(1.0, factor);
  // A step cut short by a segment's end or an edge says nothing about the next one's size.
  next_step_ = trial.is_last ? std::max(trial.length, trial.taken * factor) : trial.taken * factor;
  crossing_.otherwise = next_step_;
  // (What an implicit step thinks of its error when it is much too long is no guide; where the
  // torque is integrated, its change is compared.)
  const bool is_trusted = integrates_torque_ || !stepper_->isImplicit();
  if (trial.usual > trial.taken && is_trusted) next_step_ = std::max(next_step_, trial.usual);
  if (!finishStep()) return false;
  if (!guards_.isEmpty()) moveGuards();
  lookAhead();
  return true;
}

bool Integrator::refuse(Trial& trial, double norm) {
  ++statistics_.rejected_steps;
  trial.length = trial.taken * control_.shrink(norm);
  front_ = base_;
  crossing_ = Crossing{};
  // Where no step however short succeeds, it may be for a jump just ahead that they all feel (a
  // Jacobian by differences, a stage).
  if (trial.rejections % kHardPressed == kHardPressed - 1 && guards_.hasJumps()) {
    hopped_ = crossJumpAhead(kAhead * settings_.maximum_step);
    if (hopped_ || !status_.ok()) return false;
  }
  if (++trial.rejections == kHopeless && choice_.giveUpExplicit()) {
    stepper_ = &choice_.stepper();
    followChoice();
  }
  return true;
}

bool Integrator::stepFixed() {
  // Multiples of the step, not sums of it: no rounding piles up.
  // (A step across an edge may have gone a little beyond the next one.)
  double grid = base_.time;
  while (!(grid > base_.time)) {
    grid = restart_time_ + static_cast<double>(++fixed_steps_) * settings_.step;
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
    const double part = estimate * settings_.relative_tolerance;
    if (part <= kCrudest) return true;  // not when NaN
    front_ = base_;
    stop(StopReason::kStepTooLarge);
    status_.measure = part;
    return false;
  }
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
  if (!stepper.projects() && !x.isFinite()) return std::numeric_limits<double>::quiet_NaN();
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

double Integrator::discountRounding(double end, const State& x_old, const State& x,
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

bool Integrator::differentiateFront() {
  const bool moved = system_.restoreReaction(front_, kLittle);
  if (stepper_->projects() && !moved) {
    front_.dxdt = dxdt_new_;
  } else {
    system_(front_.x, front_.dxdt, front_.time);
  }
  return front_.dxdt.isFinite();
}

bool Integrator::finishStep() {
  checks_.noteTorqueRate(front_);
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

double Integrator::checkAccelerations() {
  // Just before a jump of the torque what lies beside the end may lie behind it.
  if (crossing_.isDueAt(front_.time) && guards_.guard(crossing_.guard).jumps()) return 0.0;
  const State* dxdt = stepper_->projects() ? &dxdt_new_ : nullptr;
  return checks_.checkAccelerations(*stepper_, base_, front_.time, front_.x, dxdt);
}

}  // namespace variator_sim
