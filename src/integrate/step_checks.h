/// Checks of a step beside its error estimate.
///
/// An estimate is of the states of the stages. A torque that acts in a narrow layer between two
/// stages, and accelerations that answer to the least change of the state, are none of its business
/// and are looked at here. Each principle has one check of either kind: where the state has the
/// accelerations (System::integratesTorque) the torque enters by its rate and `checkTorque` looks
/// at its integral; where they follow from the state `checkAccelerations` asks for their error and
/// `isTorqueFollowed` for layers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "dynamics/projection.h"
#include "dynamics/system.h"
#include "integrate/step_control.h"
#include "integrate/stepper.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// An error norm that makes StepControl take a step no shorter, at every order.
constexpr double kSteadyNorm = 0.1;

/// The checks of the steps of one motion. Norms are in units of the tolerance, and a step is good
/// at most 1. All are [loop].
class StepChecks {
 public:
  /// `system` and `statistics` have to outlive this. `are_steps_fixed`: errors are told and reject
  /// no step.
  StepChecks(System& system, Tolerance tolerance, bool are_steps_fixed, Statistics& statistics)
      : S(system.shafts()),
        integrates_torque_(system.integratesTorque()),
        system_(system),
        drivetrain_(system.drivetrain()),
        tolerance_(tolerance),
        are_steps_fixed_(are_steps_fixed),
        statistics_(statistics),
        nothing_(S),
        largest_acceleration_(S),
        largest_torque_(S) {}

  /// Forgets what belongs to a motion.
  void reset();

  /// The error of a step is at most the tolerance; where steps are fixed, it only exists.
  bool isGood(double norm) const {
    return norm <= 1.0 || (are_steps_fixed_ && std::isfinite(norm));
  }
  /// A step of length h from `from` to `end`, on the constraints: x there. The error, in units of
  /// the tolerance.
  double stepAndProject(Stepper& stepper, const StepNode& from, double end, double h, State& x);
  /// Notes the rounding of the time and of a state x that is reached elsewhere, if it is larger
  /// than the tolerance.
  void noteProjectionRounding(double end, const State& x);
  /// Counts such a rounding, in tolerances.
  void noteRounding(double largest);

  /// Writes Q and Q' of `node`, whose derivative is known and is the last that was taken.
  void noteTorque(StepNode& node);
  /// Q' alone, where the derivative has it.
  void noteTorqueRate(StepNode& node);
  /// How large accelerations that follow from the state have been lately: what a transient has left
  /// long ago says nothing of now, but they may well be zero for a moment.
  void noteAccelerations(const StepNode& node);

  /// The state has the accelerations, and so the applied torque enters by its rate alone: a step
  /// that passes over a narrow layer (dry friction around standstill) or a kink may know nothing of
  /// it. But Q itself is known at both ends, and
  ///     d = Q(to) - Q(from) - h sum b_i Q'_i
  /// is what the stages have not seen of it: an error J^-1 d of the accelerations. Its size; 0
  /// where the torque is no rate's integral. Writes Q at `to`.
  ///
  /// The effect on Q of rounding in the angles and velocities does not count: a hard coupling
  /// between shafts that have turned many times makes it large.
  ///
  /// If Q is steep in the velocities (stiff friction, under an implicit step), an allowed error of
  /// the accelerations has moved the velocities over the step by enough to be many times larger in
  /// d: its effect on Q is allowed, too, as long as Q is about linear over so much.
  double checkTorque(Stepper& stepper, const StepNode& from, StepNode& to);

  /// A step from where Q is this has compared Q by itself.
  void noteTorqueSize(const double* torque) {
    for (int i = 0; i < S; ++i) {
      largest_torque_[i] = std::max(largest_torque_[i], std::abs(torque[i]));
    }
  }

  /// The counterpart of checkTorque where the torques make the accelerations themselves: an
  /// explicit step of controlled size may not pass over a narrow layer of Q. Its ends tell: false
  /// where Q changes by much that the rates there (trapezoidal rule) do not explain, and a velocity
  /// could err by that. Writes Q and Q' at `to`, whose derivative is known.
  bool isTorqueFollowed(const Stepper& stepper, const StepNode& from, StepNode& to);

  /// Returns the error of accelerations that follow from the state, due to the error of x at the
  /// end of the step, in tolerances. (Short time constants make it large.) The part due to rounding
  /// of x alone does not count: shorter steps do not help. It is left in `unattainable`.
  ///
  /// Implicit stages that hold psi = 0 have errors along that, and so has x once it is projected.
  double checkAccelerations(const Stepper& stepper, const StepNode& from, double end,
                            const State& x);
  /// Returns the effect of four roundings of the state on accelerations that follow from it, in
  /// tolerances, as the last checkAccelerations found it; 0 if it had no need to know.
  double unattainable() const { return unattainable_; }
  /// The torque element that answers most steeply where that is too much, even beside the torques
  /// that balance each other in an acceleration: these are known to the tolerance only. -1 else.
  /// (Errors of a step up to rounding are ignored, and some of them add up.)
  int steepestTorque() const { return steepest_; }

 private:
  /// Projects x, to which `stepper` has gone from x_old by h and which stands at `end`; the size of
  /// the move in units of the tolerance (an error measure that is independent of the stepper's), or
  /// NaN when it failed.
  ///
  /// Rounding alone counts for nothing: shorter steps do not help. The rounding is calculated only
  /// where the move is more than a step's own error `estimate`.
  double projectEnd(const Stepper& stepper, const State& x_old, double end, double h,
                    double estimate, State& x);
  /// The size of a move onto the constraints without what rounding makes of it; where that is more
  /// than the tolerance it is told.
  double discountRounding(double end, const State& x_old, const State& x, const State& moved);
  /// Calculates the rounding of a move onto the constraints at x, component by component. Returns
  /// the largest, in tolerances.
  double calcRounding(double end, const State& x, State& rounding);
  /// Projects x, which the last step of an implicit stepper, of size h, has reached at `end`.
  ProjectionResult projectStiffly(const Stepper& stepper, double end, double h, State& x,
                                  State& moved, std::uint64_t* iterations);

  /// The view of a node whose accelerations are known and no state.
  StateView viewDerived(const StepNode& node) {
    return drivetrain_.view(node.time, node.x.data(), node.x.data() + S, node.dxdt.data() + S);
  }
  void calcTorque(StepNode& node);
  double inertiaOf(int i) const { return drivetrain_.inertia().entry(i, i); }

  /// See steepestTorque. `uncertain` is what `rounded`, beside x, makes of the accelerations.
  void findSteepest(double end, const State& x, const State& rounded, const State& uncertain);
  /// The error of acceleration i that is allowed in a step, times its inertia, N m.
  double calcAllowed(const StepNode& from, const StepNode& to, int i) const;
  /// Computes the effect on Q of rounding in each angle and velocity at `to` (`uncertain`, N m),
  /// and that of the allowed errors of the accelerations through the velocities (`answer`, N m).
  void calcAnswers(const StepNode& from, const StepNode& to, ShaftVector& uncertain,
                   ShaftVector& answer);
  /// Adds the effect on Q of rounding inside the laws' formulas of the time (sin(t + 1e8) knows its
  /// argument to 1e-8): the departure of Q from a smooth function over negligible times. A
  /// departure that is the same over times of any size is rounding, however large (1e10 (sin(t) -
  /// 0.999)).
  void addTimeNoise(const StepNode& to, ShaftVector& uncertain);
  /// The size of d, see checkTorque, when `uncertain` is left aside.
  double judgeTorque(const TorqueGain& gain, const StepNode& from, const StepNode& to,
                     const ShaftVector& uncertain, const ShaftVector& answer) const;

  /// Adds some four roundings of x to y: of different sign and size, lest those of two angles
  /// cancel in their difference.
  static void round(const State& x, State& y);
  /// |x'(y) - here| of the accelerations.
  void calcChange(double t, const State& y, const State& here, State& change);

  /// True when accelerations answer to a change of the state (from x to `beside`, by `change`) so
  /// strongly that no explicit step of size h is stable. Its stages may know nothing of it where a
  /// motion lies exactly on a stiff constraint's slow one; the next rounding would grow without
  /// bound.
  bool isUnstable(double h, const State& x, const State& beside, const State& change) const;
  /// True when accelerations answer to a change of the velocities (from x to `beside`, by `change`)
  /// many times within a step of size h: an implicit step then follows a slow motion.
  bool isOnSlowMotion(double h, const State& x, const State& beside, const State& change) const;
  /// On the slow motion of something stiff an implicit step leaves velocities of order 5, but their
  /// slopes, the accelerations, of order 3 only (the component z of index 2; Hairer, Wanner:
  /// Solving ODE II, VII.4), and its error estimate is of the velocities. How far the slope of its
  /// polynomial at its beginning is from the accelerations there measures that, one to ten times
  /// too large.
  double checkFirstSlope(const Stepper& stepper, const StepNode& from, double end) const;

  /// See steepestTorque.
  static constexpr double kAttainable = 50.0;
  /// The |h lambda| (h^2 times a stiffness) of explicit steps is some ten at most.
  static constexpr double kMostStable = 100.0;
  /// The error norm given to a step beyond that.
  static constexpr double kUnstable = 4.0;
  /// The |h lambda| above which an implicit step is on a slow motion.
  static constexpr double kSlow = 10.0;
  /// Tolerances that the first slope may be off, see checkFirstSlope.
  static constexpr double kFirstSlope = 30.0;
  /// Tolerances of a velocity that may go unexplained by the rates of Q at a step's ends.
  static constexpr double kUnseen = 30.0;
  /// Component by component an estimated error may be some times too small.
  static constexpr double kCaution = 4.0;

  const int S;  // shafts
  const bool integrates_torque_;
  System& system_;
  Drivetrain& drivetrain_;  // the system's
  Tolerance tolerance_;
  bool are_steps_fixed_;
  Statistics& statistics_;
  double unattainable_ = 0.0;
  int steepest_ = -1;
  const ShaftVector nothing_;
  ShaftVector largest_acceleration_;  // of late, see noteAccelerations
  ShaftVector largest_torque_;        // that a step began with, N m
};

}  // namespace variator_sim
