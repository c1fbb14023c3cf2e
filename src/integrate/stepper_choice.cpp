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
    first_ = make(settings.relative_tolerance <= kHighOrderBelow ? StepperKind::kDop853
                                                                 : StepperKind::kDopri5);
    implicit_ = make(StepperKind::kRadau);
    if (system.series() != nullptr) series_ = make(StepperKind::kTaylor);
  }
  reset();
}

std::string StepperChoice::describe() const {
  if (!automatic_) return std::string(stepper().name()) + " (as the scene says)";
  std::ostringstream text;
  text << "auto (";
  if (active_ == &series_) {
    text << series_.outer->name() << ", the series of this scene; " << implicit_.outer->name()
         << " when stability limits its steps";
  } else if (active_ == &first_) {
    text << first_.outer->name() << ", as the relative tolerance is "
         << (relative_tolerance_ <= kHighOrderBelow ? "at most " : "above ") << kHighOrderBelow
         << "; " << implicit_.outer->name() << " when stability limits its steps";
  } else {
    text << implicit_.outer->name() << ", as stability limited the steps of "
         << (series_.outer ? series_ : first_).outer->name()
         << (settled_         ? " near rest"
             : switches_ == 0 ? " at the start"
                              : "");
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
  active_ = implicitly ? &implicit_ : automatic_ ? preferred() : &first_;
  switches_ = 0;
  trial_interval_ = kFirstTrial;
  wait_ = kSuspicions;
  challenged_ = nullptr;
  restart();
}

void StepperChoice::forget() {
  for (Pair* pair : {&series_, &first_, &implicit_}) {
    if (!pair->outer) continue;
    pair->outer->forget();
    pair->inner->forget();
  }
}

void StepperChoice::restart() {
  if (challenged_ != nullptr) giveUpTrial();
  if (settled_ || (automatic_ && active_ == &first_)) active_ = preferred();
  settled_ = false;
  settling_ = 0;
  suspicions_ = 0;
  quiet_ = 0;
  unseen_ = 0;
  steps_since_trial_ = 0;
  for (Pair* pair : {&series_, &first_, &implicit_}) {
    if (!pair->outer) continue;
    pair->outer->restart();
    pair->inner->restart();
  }
}

bool StepperChoice::leaveSeries() {
  if (!automatic_ || active_ != &series_) return false;
  goOverTo(&first_);
  return true;
}

bool StepperChoice::giveUp() {
  if (challenged_ != nullptr) {
    giveUpTrial();
    return true;
  }
  if (!automatic_ || active_ == &implicit_) return false;
  goOverTo(active_ == &series_ ? &first_ : &implicit_);
  return true;
}

bool StepperChoice::settle(const StepNode& node, double change) {
  if (!automatic_ || active_ == &implicit_) return false;
  const bool near_rest =
      change <= kNearRest && active_->outer->stiffness(node.x, node.dxdt) > mildly();
  settling_ = near_rest ? settling_ + 1 : 0;
  if (settling_ < kSettling) return false;
  goOverTo(&implicit_);
  settled_ = true;
  return true;
}

bool StepperChoice::reconsider(System& system, const StepNode& node, double limit, double* h) {
  if (challenged_ != nullptr) return judgeImplicit(limit, h);
  if (active_ == &implicit_) return considerExplicit(system, node, limit, h);
  if (active_ == &first_ && series_.outer && ++steps_since_trial_ >= kAround) {
    goOverTo(&series_);
    return true;
  }
  return considerImplicit(node, *h);
}

bool StepperChoice::considerImplicit(const StepNode& node, double h) {
  // Of a stepper that nothing is held against not every step is looked at.
  if (suspicions_ == 0 && settling_ == 0 && ++unseen_ < kUnseen) return false;
  unseen_ = 0;
  const double stiffness = active_->outer->stiffness(node.x, node.dxdt);
  if (stiffness <= mildly()) {
    // A few steps below the bound between others above it clear nobody.
    if (++quiet_ >= kQuiet) suspicions_ = quiet_ = 0;
    return false;
  }
  quiet_ = 0;
  if (settling_ > 0) return false;  // of which `settle` decides
  suspicions_ += stiffness > 1.0 ? kStrong : 1;
  if (suspicions_ < wait_) return false;
  suspicions_ = 0;
  challenged_ = active_;
  challenged_step_ = h;
  goOverTo(&implicit_);
  return true;  // h stays: the first step damps
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
  const double reached = tryStep(system, *preferred()->outer, node, std::min(limit, *h));
  if (getsFurther(*preferred(), reached, implicit_, *h)) {
    goOverTo(preferred());
    wait_ = kSuspicions;
    *h = reached;
    return true;
  }
  trial_interval_ = std::min(2 * trial_interval_, kLastTrial);
  return false;
}

double StepperChoice::tryStep(System& system, Stepper& stepper, const StepNode& node, double h) {
  State x(system.size());
  State dxdt(system.size());
  for (int attempt = 0; attempt < 4; ++attempt) {
    const double norm = stepper.step(system, node, h, x, dxdt);
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
                                double other_step) {
  return step / one.outer->work() > kAdvantage * (other_step / other.outer->work());
}

void StepperChoice::goOverTo(Pair* other) {
  active_ = other;
  ++switches_;
  suspicions_ = quiet_ = unseen_ = steps_since_trial_ = 0;
}

}  // namespace variator_sim
