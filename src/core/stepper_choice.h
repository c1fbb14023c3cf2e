/// Which stepper makes the next step: the one that the scene names, or `auto`.
///
/// The rule of `auto`:
/// - It starts explicitly: dop853 where the relative tolerance is at most kHighOrderBelow, dopri5
///   above.
/// - At the start of a motion the Jacobian tells the fastest component: where the first step that
///   the slopes suggest is kStiffStart times as long as its 1/|lambda|, radau5 begins.
/// - After five steps that stability and not accuracy limited (|h lambda| at the bound of the
///   scheme, as Hairer's codes estimate it), or forty at a quarter of the bound, it tries implicit
///   steps from the same state. When the step sizes that the two error estimates allow say that
///   radau5 gets further for the same work, it goes on with that; else it waits four times as long.
/// - A step that the explicit stepper has to repeat kHopeless times (motion_of.h) goes to radau5 as
///   well.
/// - Near rest (kSettling steps in a row that stability limits and that change the state by some
///   tolerances only) it goes to radau5 without a trial, and back at the next command: the error of
///   explicit steps at the bound of stability would keep the motion from ever coming to rest.
/// - From time to time (kFirstTrial implicit steps, doubled after every trial that fails) it tries
///   one explicit step in the same way, and goes back when that gets further.
/// All of it depends on the motion only, so it repeats to the bit.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <sstream>
#include <string>

#include "stepper.h"

namespace variator_sim {

class StepperChoice {
 public:
  StepperChoice(const System& system, const SolverSettings& settings)
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
      implicit_ = make(StepperKind::kRadau5);
    }
    reset();
  }

  bool isAutomatic() const { return automatic_; }
  /// True when steps have the size that the scene gives, whatever their error.
  bool isFixed() const { return fixed_; }
  /// Makes the steps.
  Stepper& stepper() { return *active_->outer; }
  /// One of the same kind as `stepper`, for steps aside that leave its dense output whole.
  Stepper& innerOf(const Stepper& stepper) {
    return &stepper == first_.outer.get() ? *first_.inner : *implicit_.inner;
  }
  const Stepper& stepper() const { return *active_->outer; }
  std::uint64_t switches() const { return switches_; }
  /// What steps, and why.
  std::string describe() const {
    if (!automatic_) return std::string(stepper().name()) + " (as the scene says)";
    std::ostringstream text;
    text << "auto (";
    if (active_ == &first_) {
      text << first_.outer->name() << ", as the relative tolerance is "
           << (relative_tolerance_ <= kHighOrderBelow ? "at most " : "above ") << kHighOrderBelow
           << "; " << implicit_.outer->name() << " when stability limits its steps";
    } else {
      text << implicit_.outer->name() << ", as stability limited the steps of "
           << first_.outer->name()
           << (settled_         ? " near rest"
               : switches_ == 0 ? " at the start"
                                : "");
    }
    if (switches_ > 0) text << "; changed " << switches_ << (switches_ == 1 ? " time" : " times");
    text << ")";
    return text.str();
  }

  /// True when a motion that starts at `node` with a step of size h is better begun implicitly.
  bool isStiffStart(System& system, const StepNode& node, double h) const {
    if (!automatic_) return false;
    Linearization linearization(system.shafts(), system.size() / system.shafts());
    system.calcLinearization(node.time, node.x, linearization);
    const double rate = linearization.calcFastestRate();
    return std::isfinite(rate) && h * rate > kStiffStart;
  }

  /// The start of a motion, with the first stepper or, of `auto`, the implicit one.
  void reset(bool implicitly = false) {
    active_ = implicitly ? &implicit_ : &first_;
    switches_ = 0;
    trial_interval_ = kFirstTrial;
    wait_ = kSuspicions;
    restart();
  }
  /// The motion begins anew at some state.
  void restart() {
    if (settled_) active_ = &first_;
    settled_ = false;
    settling_ = 0;
    suspicions_ = 0;
    quiet_ = 0;
    steps_since_trial_ = 0;
    for (Pair* pair : {&first_, &implicit_}) {
      if (!pair->outer) continue;
      pair->outer->restart();
      pair->inner->restart();
    }
  }

  /// The explicit stepper gets nowhere: true when the implicit one takes over.
  bool giveUpExplicit() {
    if (!automatic_ || active_ != &first_) return false;
    goOverTo(&implicit_);
    return true;
  }

  /// After an accepted step to `node` of a motion that may come to rest, in which x changed by
  /// `change` tolerances: true when the implicit stepper takes over to let it settle. [loop]
  bool settle(const StepNode& node, double change) {
    if (!automatic_ || active_ != &first_) return false;
    const bool near_rest =
        change <= kNearRest && active_->outer->stiffness(node.x, node.dxdt) > kMildly;
    settling_ = near_rest ? settling_ + 1 : 0;
    if (settling_ < kSettling) return false;
    settled_ = giveUpExplicit();
    return settled_;
  }

  /// After an accepted step to `node`, the next one to be of size `h`: true when the stepper was
  /// changed, `h` then being its step. [loop]
  bool reconsider(System& system, const StepNode& node, double limit, double* h) {
    return active_ == &first_ ? considerImplicit(system, node, limit, h)
                              : considerExplicit(system, node, limit, h);
  }

 private:
  struct Pair {
    std::unique_ptr<Stepper> outer;
    std::unique_ptr<Stepper> inner;
  };

  bool considerImplicit(System& system, const StepNode& node, double limit, double* h) {
    const double stiffness = active_->outer->stiffness(node.x, node.dxdt);
    if (stiffness <= kMildly) {
      // A few steps below the bound between others above it clear nobody.
      if (++quiet_ >= kQuiet) suspicions_ = quiet_ = 0;
      return false;
    }
    quiet_ = 0;
    suspicions_ += stiffness > 1.0 ? kStrong : 1;
    if (suspicions_ < wait_) return false;
    suspicions_ = 0;
    // The fast components of an explicit run carry an error of the tolerance's size, which an
    // implicit step damps and its error estimate sees: one step to damp it, the next one counts.
    StepNode damped = node;
    State unused(system.size());
    const double first = std::min(limit, *h);
    if (!std::isfinite(implicit_.outer->step(system, node, first, damped.x, unused))) return false;
    damped.time += first;
    system(damped.x, damped.dxdt, damped.time);
    const double next = std::min(limit - first, 10.0 * *h);
    const double reached = next > 0.0 ? tryStep(system, *implicit_.outer, damped, next) : 0.0;
    return change(&implicit_, reached, *h);  // h stays: it grows within a few steps
  }

  bool considerExplicit(System& system, const StepNode& node, double limit, double* h) {
    if (++steps_since_trial_ < trial_interval_) return false;
    steps_since_trial_ = 0;
    const double reached = tryStep(system, *first_.outer, node, std::min(limit, *h));
    if (change(&first_, reached, *h)) {
      *h = reached;
      return true;
    }
    trial_interval_ = std::min(2 * trial_interval_, kLastTrial);
    return false;
  }

  /// The step that `stepper` could make from `node`: tried from h on, shorter until its error
  /// estimate accepts it; 0 when none of a few is.
  static double tryStep(System& system, Stepper& stepper, const StepNode& node, double h) {
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

  /// Goes over to `other`, which could make steps of size `reached`, when that is better than `h`
  /// by the one in use.
  bool change(Pair* other, double reached, double h) {
    const double now = h / active_->outer->work();
    const double then = reached / other->outer->work();
    if (!(then > kAdvantage * now)) {
      if (other == &implicit_) wait_ = std::min(4 * wait_, kStrong * kLastTrial);
      return false;
    }
    goOverTo(other);
    wait_ = kSuspicions;
    return true;
  }

  void goOverTo(Pair* other) {
    active_ = other;
    ++switches_;
    suspicions_ = quiet_ = steps_since_trial_ = 0;
  }

  /// At higher accuracy than this dop853 needs fewer evaluations than dopri5.
  static constexpr double kHighOrderBelow = 1e-5;
  /// |h lambda| over its bound: above 1 a step counts kStrong times, above kMildly once (at tight
  /// tolerances a fast component limits steps well below the bound, by its rounding).
  static constexpr double kMildly = 0.25;
  static constexpr int kStrong = 8;
  static constexpr int kSuspicions = 40;
  static constexpr int kQuiet = 6;
  static constexpr double kStiffStart = 20.0;
  /// Changes of x per step, in tolerances, that are near rest, and so many steps of them.
  static constexpr double kNearRest = 100.0;
  static constexpr int kSettling = 10;
  static constexpr int kFirstTrial = 25;
  static constexpr int kLastTrial = 1000;
  /// Work is known roughly only, and a change costs a few short steps.
  static constexpr double kAdvantage = 1.2;

  bool automatic_;
  bool fixed_;
  double relative_tolerance_;
  Pair first_;     // the one named, or the explicit one
  Pair implicit_;  // of `auto` only
  Pair* active_ = nullptr;
  std::uint64_t switches_ = 0;
  int suspicions_ = 0;
  int quiet_ = 0;
  bool settled_ = false;
  int settling_ = 0;
  int wait_ = kSuspicions;
  int steps_since_trial_ = 0;
  int trial_interval_ = kFirstTrial;
};

}  // namespace variator_sim
