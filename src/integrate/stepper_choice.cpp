#include "integrate/stepper_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

StepperChoice::StepperChoice(const System& system, const SolverSettings& settings)
    : automatic_(settings.stepper == StepperKind::kAuto),
      fixed_(isFixedStep(settings.stepper)),
      relative_tolerance_(settings.relative_tolerance) {
  const Tolerance tolerance{settings.absolute_tolerance, settings.relative_tolerance};
  const auto make = [&](StepperKind kind) {
    return Pair{makeStepper(kind, system, tolerance), makeStepper(kind, system, tolerance)};
  };
  if (!automatic_) {
    first_ = make(settings.stepper);
  } else {
    first_ = make(system.series() != nullptr ? StepperKind::kTaylor : StepperKind::kDopri5);
    implicit_ = make(StepperKind::kRadau);
  }
  reset();
}

std::string StepperChoice::describe() const {
  if (!automatic_) return std::string(stepper().name()) + " (as the scene says)";
  std::ostringstream text;
  text << "auto (";
  text << stepper().name();
  if (active_ == &first_) {
    text << (stepper().stepsBySeries() ? ", the series of this scene; " : ", without series; ")
         << implicit_.outer->name() << " when stability limits its steps";
  } else if (why_ == Why::kNoSeries) {
    text << ", as there is no power series here";
  } else {
    text << ", as stability limited the steps of " << first_.outer->name()
         << (switches_ == 0 ? " at the start" : "");
  }
  if (switches_ > 0) text << "; changed " << switches_ << (switches_ == 1 ? " time" : " times");
  text << ")";
  return text.str();
}

bool StepperChoice::isStiffStart(System& system, const StepNode& node, double h) const {
  if (!automatic_) return false;
  Linearization linearization(system.shafts(), system.size() / system.shafts());
  system.calcLinearization(node.time, node.x, linearization);
  const double rate = linearization.calcFastestRate();
  return std::isfinite(rate) && h * rate > kStiffStart;
}

void StepperChoice::reset(bool implicitly) {
  active_ = implicitly ? &implicit_ : &first_;
  why_ = Why::kStiff;
  switches_ = 0;
  trial_interval_ = kFirstTrial;
  wait_ = kSuspicions;
  challenged_ = nullptr;
  restart();
}

void StepperChoice::forget() {
  for (Pair* pair : {&first_, &implicit_}) {
    if (!pair->outer) continue;
    pair->outer->forget();
    pair->inner->forget();
  }
}

void StepperChoice::restart() {
  if (challenged_ != nullptr) giveUpTrial();
  if (why_ != Why::kStiff) active_ = &first_;
  why_ = Why::kStiff;
  suspicions_ = 0;
  quiet_ = 0;
  unseen_ = 0;
  steps_since_trial_ = 0;
  for (Pair* pair : {&first_, &implicit_}) {
    if (!pair->outer) continue;
    pair->outer->restart();
    pair->inner->restart();
  }
}

bool StepperChoice::leaveSeries() {
  if (!automatic_ || active_ == &implicit_ || !first_.outer->stepsBySeries()) return false;
  goOverTo(&implicit_);
  why_ = Why::kNoSeries;
  trial_interval_ = kAround;
  return true;
}

bool StepperChoice::giveUp() {
  if (challenged_ != nullptr) {
    giveUpTrial();
    return true;
  }
  if (!automatic_ || active_ == &implicit_) return false;
  goOverTo(&implicit_);
  return true;
}

bool StepperChoice::reconsider(System& system, const StepNode& node, double limit, double* h) {
  if (challenged_ != nullptr) return judgeImplicit(limit, h);
  if (active_ == &implicit_) return considerExplicit(system, node, limit, h);
  return considerImplicit(node, *h);
}

bool StepperChoice::considerImplicit(const StepNode& node, double h) {
  // A motion that shows no sign of stiffness is not examined at every step.
  if (suspicions_ == 0 && ++unseen_ < kUnseen) return false;
  unseen_ = 0;
  if (!addSuspicion(active_->outer->stiffness(node.x, node.dxdt))) return false;
  challenged_ = active_;
  challenged_step_ = h;
  goOverTo(&implicit_);
  return true;  // h stays: the first step damps
}

bool StepperChoice::addSuspicion(double stiffness) {
  if (stiffness <= mildly()) {
    // Isolated non-stiff steps do not reset the stiffness counter.
    if (++quiet_ >= kQuiet) suspicions_ = quiet_ = 0;
    return false;
  }
  quiet_ = 0;
  suspicions_ += stiffness > 1.0 ? kStrong : 1;
  if (suspicions_ < wait_) return false;
  suspicions_ = 0;
  return true;
}

bool StepperChoice::judgeImplicit(double limit, double* h) {
  if (++steps_since_trial_ == 1) {
    *h = std::min(limit, 10.0 * challenged_step_);
    return true;
  }
  if (getsFurther(implicit_, *h, *challenged_, challenged_step_)) {
    challenged_ = nullptr;
    wait_ = kSuspicions;
    return false;
  }
  wait_ = std::min(4 * wait_, kStrong * kLastTrial);
  *h = challenged_step_;
  giveUpTrial();
  return true;
}

void StepperChoice::giveUpTrial() {
  goOverTo(challenged_);
  switches_ -= 2;  // nothing came of it
  challenged_ = nullptr;
}

bool StepperChoice::considerExplicit(System& system, const StepNode& node, double limit,
                                     double* h) {
  if (++steps_since_trial_ < trial_interval_) return false;
  steps_since_trial_ = 0;
  const double reached = tryStep(system, *first_.outer, node, std::min(limit, *h));
  if (getsFurther(first_, reached, implicit_, *h)) {
    goOverTo(&first_);
    wait_ = kSuspicions;
    *h = reached;
    return true;
  }
  trial_interval_ = std::min(2 * trial_interval_, kLastTrial);
  return false;
}

double StepperChoice::tryStep(System& system, Stepper& stepper, const StepNode& node, double h) {
  State x(system.size());
  for (int attempt = 0; attempt < 4; ++attempt) {
    const double norm = stepper.step(system, node, h, x);
    if (!std::isfinite(norm)) {
      h *= 0.1;
      continue;
    }
    const double factor = 0.9 * std::pow(std::max(norm, 1e-10), -1.0 / stepper.errorOrder());
    if (norm <= 1.0) return h * std::min(5.0, factor);
    h *= std::max(0.1, factor);
  }
  return 0.0;
}

bool StepperChoice::getsFurther(const Pair& one, double step, const Pair& other,
                                double other_step) const {
  return step / one.outer->work() > kAdvantage * (other_step / other.outer->work());
}

void StepperChoice::goOverTo(Pair* other) {
  active_ = other;
  why_ = Why::kStiff;
  ++switches_;
  suspicions_ = quiet_ = unseen_ = steps_since_trial_ = 0;
}

}  // namespace variator_sim
