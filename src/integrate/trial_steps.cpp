#include "integrate/trial_steps.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "variator_sim/interruption.h"

namespace variator_sim {

TrialSteps::TrialSteps(CurrentStep& step, GuardSearch& guards, EventCrossing& crossing,
                       EventHandler& events, StepSize& size)
    : StepPart(step),
      guards_(guards),
      crossing_(crossing),
      events_(events),
      size_(size),
      watch_(guards) {
  if (guards_.hasJumps()) system_.watch(&watch_);
}

void TrialSteps::restart() {
  restart_time_ = end_.time;
  fixed_steps_ = 0;
}

bool TrialSteps::make() {
  Trial trial = first();
  while (aim(trial)) {
    if (trial.searches + trial.rejections > 0 && Interruption::isWanted()) return false;
    watch_.begin();
    double norm = attempt(trial);
    const bool stages_left = watch_.end();
    if (!step_.status.ok()) return false;
    const EventHandler::Finding finding = locateEvents(trial, stages_left, &norm);
    if (finding == EventHandler::Finding::kCrossed) return true;
    if (!step_.status.ok()) return false;
    if (finding == EventHandler::Finding::kShorter) continue;
    if (step_.checks.isGood(norm) && haveAccelerationsLeapt())
      norm = std::numeric_limits<double>::quiet_NaN();
    if (isHiding(trial, norm)) continue;
    if (step_.checks.isGood(norm)) {
      if (accept(trial, norm)) return true;
      if (!step_.status.ok()) return false;
      norm = std::numeric_limits<double>::quiet_NaN();
    }
    if (!reject(trial, norm)) break;
  }
  return step_.phase == StepPhase::kCrossing;
}

EventHandler::Finding TrialSteps::locateEvents(Trial& trial, bool stages_left, double* norm) {
  // Attempts that look for an event from one start.
  constexpr int kMaxSearches = 100;
  // So many events that rejected steps told of, and that were not there, make no more be told of.
  constexpr int kMaxFalseGuesses = 5;
  // This stands for the error of a step with stages on both sides of a jump.
  constexpr double kStagesLeftNorm = 100.0;
  using Finding = EventHandler::Finding;
  const bool is_good = step_.checks.isGood(*norm);
  const bool is_blind = crossing_.falseGuesses() > kMaxFalseGuesses && !is_good &&
                        trial.rejections < kRejectionsBeforeJump;
  if (guards_.isEmpty() || !std::isfinite(*norm) || trial.searches >= kMaxSearches || is_blind) {
    return Finding::kClear;
  }
  // An event may be the reason for an error that is too large.
  const Finding finding = is_good ? events_.locate(trial.taken, &trial.length)
                                  : events_.locateByEnd(trial.taken, &trial.length);
  if (!step_.status.ok()) return finding;
  if (finding == Finding::kShorter) {
    if (!step_.stepper->isImplicit() || events_.isEventOfTime(trial.taken)) {
      trial.usual = std::max(trial.usual, trial.taken);
    }
    ++trial.searches;
    ++step_.statistics.rejected_steps;
    end_ = start_;
  } else if (finding == Finding::kClear) {
    // A torque that jumps was met by the stages and not by the motion: too long a step.
    const bool counts = stages_left && !events_.isStill();
    if (counts && !step_.choice.isFixed() && *norm <= 1.0) *norm = kStagesLeftNorm;
  }
  return finding;
}

bool TrialSteps::isHiding(Trial& trial, double norm) {
  // Halvings of a step for what a formula may hide: of one so short its stages have seen all.
  constexpr int kMaxHalvings = 20;
  const bool may_halve = trial.unresolved < kMaxHalvings &&
                         trial.taken > Progress::leastAt(step_.absolute(start_.time));
  if (!step_.checks.isGood(norm) || !may_halve || isResolved(trial.taken)) return false;
  ++trial.unresolved;
  ++step_.statistics.rejected_steps;
  trial.length = 0.5 * trial.taken;
  end_ = start_;
  return true;
}

TrialSteps::Trial TrialSteps::first() {
  constexpr double kLongestRest = 1e6;  // s
  Trial trial;
  trial.segment_end = size_.endOfReach();
  trial.length = std::min(step_.next_length, step_.settings.maximum_step);
  // (Angles that nothing reads go on at constant speed.)
  const bool is_still = std::all_of(start_.dxdt.begin() + (system_.readsAngles() ? 0 : S),
                                    start_.dxdt.end(), [](double rate) { return rate == 0.0; });
  if (is_still && step_.settings.sleep && !drivetrain_.readsTime()) trial.length = kLongestRest;
  if (step_.choice.isFixed()) {
    // Multiples of the step, not sums of it: no rounding piles up.
    // (A step across an event may have gone a little beyond the next one.)
    do {
      trial.grid = restart_time_ + static_cast<double>(++fixed_steps_) * step_.settings.step;
    } while (!(trial.grid > start_.time));
    --fixed_steps_;
    trial.segment_end = std::min(trial.grid, trial.segment_end);
    trial.length = trial.segment_end - start_.time;
  }
  return trial;
}

bool TrialSteps::aim(Trial& trial) {
  // Up to the end of an input's segment at the most, and not leaving a sliver before it.
  const double reach = trial.searches > 0 ? trial.length : 1.01 * trial.length;
  trial.is_last = start_.time + reach >= trial.segment_end;
  trial.end = trial.is_last ? trial.segment_end : start_.time + trial.length;
  const bool is_fixed = step_.choice.isFixed();
  trial.taken = trial.is_last || is_fixed ? trial.end - start_.time : trial.length;
  if (trial.taken > (is_fixed ? 0.0 : std::max(shortestStep(start_.time), 1e-290))) return true;
  if (!crossing_.crossJumpAhead() && step_.status.ok()) {
    step_.explainStop();
    const int guard =
        step_.status.reason == StopReason::kStepUnderflow ? crossing_.findJumpNear() : -1;
    if (guard >= 0) step_.stopChattering(guard);
  }
  return false;
}

double TrialSteps::attempt(const Trial& trial) {
  // A check that is passed counts only so much that steps stay about as long as they are.
  const auto worseOfCheck = [](double own, double check) {
    return worseOf(own, check <= 1.0 ? std::min(check, kSteadyNorm) : check);
  };
  double norm = step_.checks.stepAndProject(*step_.stepper, start_, trial.end, trial.taken, end_.x);
  size_.followScheme();
  // These decide whether the step is good. They may keep the next one from growing, but not make
  // it shorter: what rounding leaves in them does not fall with the step.
  end_.time = trial.end;
  own_norm_ = norm;
  if (step_.checks.isGood(norm))
    norm = worseOfCheck(norm, step_.checks.checkTorque(*step_.stepper, start_, end_));
  // Just before a jump of the torque what lies beside the end may lie behind it.
  const bool is_before_jump =
      crossing_.next().isDueAt(end_.time) && guards_.guard(crossing_.next().guard).jumps();
  if (step_.checks.isGood(norm) && !is_before_jump) {
    norm = worseOfCheck(norm,
                        step_.checks.checkAccelerations(*step_.stepper, start_, end_.time, end_.x));
    if (!step_.choice.isFixed() && stopWhereToleranceIsLost()) return norm;
  }
  if (step_.checks.isGood(norm) && !step_.differentiateEnd())
    norm = std::numeric_limits<double>::quiet_NaN();
  // At the end of an input's closed form its rate may be that of the next one.
  const bool ends_input =
      drivetrain_.inputSegmentEnd() <= end_.time + shortestStep(step_.absolute(end_.time));
  if (step_.checks.isGood(norm) && !step_.choice.isFixed() && !ends_input) {
    const double estimate = step_.stepper->estimateFromEnd(start_, end_);
    own_norm_ = worseOf(own_norm_, estimate);
    norm = worseOf(norm, estimate);
  }
  return norm;
}

bool TrialSteps::accept(const Trial& trial, double norm) {
  ++step_.statistics.steps;
  if (step_.choice.isFixed()) {
    if (trial.end == trial.grid) ++fixed_steps_;
  } else {
    chooseNextStep(trial, norm);
  }
  if (!step_.checkEnd()) return false;
  if (!guards_.isEmpty()) crossing_.updateBranches();
  return !step_.choice.isFixed() || isFixedStepFine(norm);
}

bool TrialSteps::reject(Trial& trial, double norm) {
  end_ = start_;
  crossing_.next() = NextEvent{};
  if (step_.choice.isFixed()) {
    step_.explainStop();
    return false;
  }
  ++step_.statistics.rejected_steps;
  trial.length = trial.taken * size_.shrink(norm);
  // A jump just ahead, which a stage or a Jacobian by differences meets, makes every step fail,
  // however short.
  const bool is_hard_pressed =
      trial.rejections % kRejectionsBeforeJump == kRejectionsBeforeJump - 1;
  if (is_hard_pressed && (crossing_.crossJumpAhead() || !step_.status.ok())) return false;
  if (++trial.rejections == kMaxRejections && step_.choice.giveUp()) {
    step_.stepper = &step_.choice.stepper();
    size_.forgetErrors();
  }
  return true;
}

bool TrialSteps::isResolved(double taken) {
  SceneSeries* const series = system_.formulas();
  if (series == nullptr || step_.choice.isFixed() || step_.stepper->stepsBySeries()) return true;
  // phi, omega, epsilon
  double x[3][3 * kMaxShafts];
  const auto copy = [&](const State& from, const double* epsilon, double* to) {
    std::copy(from.begin(), from.end(), to);
    if (!integrates_torque_) std::copy_n(epsilon, S, to + 2 * S);
  };
  copy(start_.x, start_.dxdt.data() + S, x[0]);
  copy(end_.x, end_.dxdt.data() + S, x[2]);
  const auto at = [&](double part, const double* state) {
    return SeriesPoint{start_.time + part * taken, drivetrain_.origin(), state, nullptr};
  };
  if (!series->mayHideAlong(at(0.0, x[0]), at(1.0, x[2]))) return true;
  State middle(system_.size());
  double epsilon[kMaxShafts];
  if (!step_.stepper->interpolate(system_, start_.time + 0.5 * taken, start_, end_, middle)) {
    for (int n = 0; n < middle.size(); ++n) {
      const double bend = start_.dxdt[n] - end_.dxdt[n];
      middle[n] = 0.5 * (start_.x[n] + end_.x[n]) + 0.125 * taken * bend;
    }
  }
  for (int i = 0; i < S; ++i) epsilon[i] = 0.5 * (x[0][2 * S + i] + x[2][2 * S + i]);
  copy(middle, epsilon, x[1]);
  return series->isStepResolved(at(0.0, x[0]), at(0.5, x[1]), at(1.0, x[2]));
}

void TrialSteps::chooseNextStep(const Trial& trial, double norm) {
  double factor = size_.growth(norm, own_norm_);
  if (trial.rejections > 0) factor = std::min(1.0, factor);
  // A step cut short by a segment's end or an event says nothing about the next one's size.
  double& next = step_.next_length;
  next = trial.is_last ? std::max(trial.length, trial.taken * factor) : trial.taken * factor;
  crossing_.next().otherwise = next;
  if (trial.usual > trial.taken) next = std::max(next, trial.usual);
}

bool TrialSteps::isFixedStepFine(double norm) {
  // Error of one fixed step, relative to the state (and to absolute / relative tolerance where that
  // is larger), above which the motion stops.
  constexpr double kMaxFixedError = 0.1;
  const double estimate = worseOf(norm, step_.stepper->estimateFromEnd(start_, end_));
  step_.statistics.largest_error_estimate =
      std::max(step_.statistics.largest_error_estimate, estimate);
  // The tolerance is no bound for steps of fixed size; but a step whose error is a part of the
  // state itself describes nothing any more.
  const double part = estimate * step_.settings.relative_tolerance;
  if (part <= kMaxFixedError) return true;  // not when NaN
  end_ = start_;
  step_.stop(StopReason::kStepTooLarge);
  step_.status.measure = part;
  return false;
}

bool TrialSteps::haveAccelerationsLeapt() {
  // A psi that is linear in them has one branch only.
  const bool has_branches = drivetrain_.nonlinearAccelerations().any();
  if (integrates_torque_ || !has_branches || step_.choice.isFixed()) return false;
  constexpr double kLeap = 1e-5;
  const double part = std::max(kLeap, 10.0 * step_.settings.relative_tolerance);
  bool may_be_leap = false;
  for (int n = S; n < 2 * S; ++n) {
    const double change = std::abs(end_.dxdt[n] - start_.dxdt[n]);
    may_be_leap = may_be_leap || !(change <= part * (1.0 + std::abs(start_.dxdt[n])));
  }
  if (!may_be_leap) return false;
  const bool have_leapt = system_.haveAccelerationsLeapt(start_, end_);
  system_.view(end_.time, end_.x);  // the last that is evaluated remains the end
  return have_leapt;
}

bool TrialSteps::stopWhereToleranceIsLost() {
  const double measure = step_.checks.unattainable();
  if (measure > 1.0) {
    step_.statistics.largest_rounding = std::max(step_.statistics.largest_rounding, measure);
  }
  // A branch that rounding flips is no accuracy that is lost.
  if (step_.checks.steepestTorque() < 0 || crossing_.findJumpNear() >= 0) return false;
  end_ = start_;
  step_.explainStop(StopReason::kToleranceTooSmall);
  if (step_.status.reason == StopReason::kToleranceTooSmall) {
    step_.status.measure = measure;
    step_.status.torque = step_.checks.steepestTorque();
  }
  return true;
}

}  // namespace variator_sim
