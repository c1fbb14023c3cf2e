/// Which stepper makes the next step: the one that the scene names, or `auto`.
///
/// The rule of `auto` where the scene's program, which has one of its own (runtime/stiffness.h),
/// does not make the steps:
/// - It starts with the motion's series (taylor). Where a function of the scene is opaque, and the
///   motion has none, it steps by dopri5: fehlberg78 needs a sixth less right-hand sides at 1e-9
///   and more above 1e-7, but 13 for each sample, as it has no dense output.
/// - Where no series exists for a moment (a root at 0) radau makes kAround steps or more.
/// - At the start of a motion the Jacobian tells the fastest component: where the first step that
///   the slopes suggest is kStiffStart times as long as its 1/|lambda|, radau begins.
/// - After five steps (or twelve, as only every eighth is looked at before there is a suspicion)
///   that stability and not accuracy limited (|h lambda| at the bound of the
///   scheme, as Hairer's codes estimate it), or forty well below the bound, it makes two implicit
///   steps. When the next one that their error estimate allows gets further for the same work than
///   the last explicit one, it goes on with them; else it goes back and waits four times as long.
///   The first is as long as the explicit ones: the fast components of an explicit run carry an
///   error of the tolerance's size, which an implicit step damps and its error estimate sees.
/// - A step that has to be repeated kMaxRejections times (trial_steps.h) goes to radau; from
///   implicit ones on trial back to where they came from.
/// - From time to time (kFirstTrial implicit steps, doubled after every trial that fails) it tries
///   one step by what it started with in the same way, and goes back when that gets further.
/// All of it depends on the motion only, so it repeats to the bit.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <sstream>
#include <string>

#include "integrate/stepper.h"

namespace variator_sim {

class StepperChoice {
 public:
  StepperChoice(const System& system, const SolverSettings& settings);

  bool isAutomatic() const { return automatic_; }
  /// True when `auto` steps implicitly.
  bool isImplicit() const { return active_ == &implicit_ && why_ == Why::kStiff; }
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
  /// Returns the stepper in use and the reason for it, as a sentence.
  std::string describe() const;

  /// True when a motion that starts at `node` with a step of size h is better begun implicitly.
  bool isStiffStart(System& system, const StepNode& node, double h) const;

  /// The start of a motion, with the first stepper or, of `auto`, the implicit one.
  void reset(bool implicitly = false);
  /// Nothing is left of what was stepped before.
  void forget();
  /// The motion begins anew at some state.
  void restart();

  /// The motion has no series here: true when the implicit stepper takes over for some steps.
  bool leaveSeries();
  /// The stepper gets nowhere: true when another one takes over.
  bool giveUp();

  /// After an accepted step to `node`, the next one to be of size `h`: true when the stepper was
  /// changed, `h` then being its step. [loop]
  bool reconsider(System& system, const StepNode& node, double limit, double* h);

 private:
  struct Pair {
    std::unique_ptr<Stepper> outer;
    std::unique_ptr<Stepper> inner;
  };

  bool addSuspicion(double stiffness);
  /// After an explicit step: true when implicit ones are to be tried from now on.
  bool considerImplicit(const StepNode& node, double h);
  /// After one of these: true when the next step is not what its error estimate allows.
  bool judgeImplicit(double limit, double* h);
  void giveUpTrial();

  bool considerExplicit(System& system, const StepNode& node, double limit, double* h);

  /// The step that `stepper` could make from `node`: tried from h on, shorter until its error
  /// estimate accepts it; 0 when none of a few is.
  static double tryStep(System& system, Stepper& stepper, const StepNode& node, double h);

  /// For the same work, and by more than a change costs.
  bool getsFurther(const Pair& one, double step, const Pair& other, double other_step) const;
  void goOverTo(Pair* other);

  /// |h lambda| over its bound: above 1 a step counts kStrong times, above this once. At tight
  /// tolerances a fast component limits steps well below the bound, by its rounding, and implicit
  /// steps of order 13 may be longer even where explicit ones are far from it.
  double mildly() const { return relative_tolerance_ <= 1e-5 ? 0.1 : 0.25; }
  static constexpr int kStrong = 8;
  static constexpr int kSuspicions = 40;
  static constexpr int kQuiet = 6;
  static constexpr int kUnseen = 8;
  static constexpr double kStiffStart = 20.0;
  /// Implicit steps before a series that did not exist is tried again.
  static constexpr int kAround = 10;
  static constexpr int kFirstTrial = 25;
  static constexpr int kLastTrial = 1000;
  /// Work is known roughly only, and a change costs a few short steps.
  static constexpr double kAdvantage = 1.2;

  bool automatic_;
  bool fixed_;
  double relative_tolerance_;
  Pair first_;     // the one named, or what `auto` starts with
  Pair implicit_;  // of `auto` only
  Pair* active_ = nullptr;
  Pair* challenged_ =
      nullptr;  ///< while implicit steps are tried: what they have to be better than
  double challenged_step_ = 0.0;
  std::uint64_t switches_ = 0;
  int suspicions_ = 0;
  int quiet_ = 0;
  int unseen_ = 0;  ///< steps since it was last asked for
  /// Reasons for implicit steps. All but the first one end with the next command.
  enum class Why { kStiff, kNoSeries };
  Why why_ = Why::kStiff;
  int wait_ = kSuspicions;
  int steps_since_trial_ = 0;
  int trial_interval_ = kFirstTrial;
};

}  // namespace variator_sim
