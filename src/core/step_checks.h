/// What must hold of a step beside its error estimate.
///
/// An estimate is of the states of the stages. A torque that acts in a narrow layer between two
/// stages, and accelerations that answer to the least change of the state, are none of its business
/// and are looked at here. Each principle has one check of either kind: where the state has the
/// accelerations (kIntegratesTorque) the torque enters by its rate and `checkTorque` looks at its
/// integral; where they follow from the state `checkAccelerations` asks for their error and
/// `isTorqueFollowed` for layers.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "principle_system.h"
#include "projection.h"
#include "step_control.h"
#include "stepper.h"

namespace variator_sim {

/// Projects x, which a step of size h by `stepper` has reached at t, as that stepper's states need
/// it; `slope` is x' of its polynomial there (of a stepper that keeps constraints).
inline ProjectionResult projectStiffly(PrincipleSystem& system, const Stepper& stepper, double t,
                                       double h, const State& slope, State& x, State& moved,
                                       std::uint64_t* iterations) {
  // Accelerations that are no state are the slope's; without one there is nothing stiff to do.
  return system.integratesTorque() || stepper.keepsConstraints()
             ? system.projectStiffly(t, h, slope, x, moved, iterations)
             : system.project(t, x, moved, iterations);
}
/// The same at the end of the stepper's last step.
inline ProjectionResult projectStiffly(PrincipleSystem& system, const Stepper& stepper, double end,
                                       double h, State& x, StepProjection& projection) {
  StepNode from(system);
  StepNode to(system);
  from.time = end - h;
  to.time = end;
  State slope(x.size());
  if (stepper.keepsConstraints()) stepper.calcSlope(end, from, to, slope);
  return projectStiffly(system, stepper, end, h, slope, x, projection.moved,
                        &projection.iterations);
}

/// The checks of the steps of one motion. Norms are in units of the tolerance, and a step is good
/// at most 1. All are [loop].
class StepChecks {
 public:
  /// `system` has to outlive this. `are_steps_fixed`: errors are told and refuse no step.
  StepChecks(PrincipleSystem& system, Tolerance tolerance, bool are_steps_fixed)
      : S(system.shafts()),
        integrates_torque_(system.integratesTorque()),
        system_(system),
        drivetrain_(system.drivetrain()),
        tolerance_(tolerance),
        are_steps_fixed_(are_steps_fixed),
        largest_acceleration_(S),
        largest_torque_(S) {}

  /// Forgets what belongs to a motion.
  void reset() {
    largest_acceleration_.fill(0.0);
    largest_torque_.fill(0.0);
  }

  /// Writes Q and Q' of `node`, whose derivative is known and is the last that was taken.
  void noteTorque(StepNode& node) {
    calcTorque(node);
    noteTorqueRate(node);
    if (!integrates_torque_) {
      drivetrain_.calcTorqueRate(viewDerived(node), node.torque_rate.data());
    }
  }
  /// Q' alone, where the derivative has it.
  void noteTorqueRate(StepNode& node) {
    if (integrates_torque_) {
      std::copy_n(system_.torqueRate(), S, node.torque_rate.begin());
    }
  }
  /// How large accelerations that follow from the state have been lately: what a transient has left
  /// long ago says nothing of now, but they may well be zero for a moment.
  void noteAccelerations(const StepNode& node) {
    if (!integrates_torque_) {
      const double memory = tolerance_.absolute > 0.0 ? 0.9 : 1.0;
      for (int i = 0; i < S; ++i) {
        double& largest = largest_acceleration_[i];
        largest = std::max(memory * largest, std::abs(node.dxdt[S + i]));
      }
    }
  }

  /// The state has the accelerations, and so the applied torque enters by its rate alone: a step
  /// that passes over a narrow layer (dry friction around standstill) or a kink may know nothing of
  /// it. But Q itself is known at both ends, and
  ///     d = Q(to) - Q(from) - h sum b_i Q'_i
  /// is what the stages have not seen of it: an error J^-1 d of the accelerations. Its size; 0
  /// where the torque is no rate's integral. Writes Q at `to`.
  ///
  /// What rounding of the angles and velocities makes of Q counts for nothing: a hard coupling
  /// between shafts that have turned many times makes it large.
  ///
  /// Where Q answers strongly to the velocities (stiff friction, under an implicit step) an error
  /// of the accelerations that is allowed has moved them, over the step, by enough to be many times
  /// larger in d: what it makes of Q is allowed, too.
  double checkTorque(Stepper& stepper, const StepNode& from, StepNode& to) {
    if (integrates_torque_) {
      if (!drivetrain_.hasTorques()) return 0.0;
      for (int i = 0; i < S; ++i) {
        largest_torque_[i] = std::max(largest_torque_[i], std::abs(from.torque[i]));
      }
      calcTorque(to);
      TorqueGain gain(S);
      stepper.calcTorqueGain(system_, from, to, gain);
      const double strict = judgeTorque(gain, from, to, ShaftVector(S), ShaftVector(S));
      if (strict <= 1.0 || strict != strict) return strict;
      ShaftVector uncertain(S);
      ShaftVector answer(S);
      calcAnswers(from, to, uncertain, answer);
      return judgeTorque(gain, from, to, uncertain, answer);
    }
    return 0.0;
  }

  /// The counterpart of checkTorque where the torques make the accelerations themselves: an
  /// explicit step of controlled size may not pass over a narrow layer of Q. Its ends tell: false
  /// where Q changes by much that the rates there (trapezoidal rule) do not explain, and a velocity
  /// could err by that. Writes Q and Q' at `to`, whose derivative is known.
  bool isTorqueFollowed(const Stepper& stepper, const StepNode& from, StepNode& to) {
    if (!integrates_torque_) {
      if (!drivetrain_.hasTorques() || are_steps_fixed_) return true;
      noteTorque(to);
      if (stepper.isImplicit()) return true;
      const double h = to.time - from.time;
      for (int i = 0; i < S; ++i) {
        const double d = std::abs(to.torque[i] - from.torque[i] -
                                  0.5 * h * (to.torque_rate[i] + from.torque_rate[i]));
        if (h * d <= kUnseen * inertiaOf(i) * tolerance_.of(to.x[S + i])) continue;
        const double steepest =
            std::max(std::abs(to.torque_rate[i]), std::abs(from.torque_rate[i]));
        if (d > 0.5 * h * steepest) return false;
      }
    }
    return true;
  }

  /// Where the accelerations are no part of the state but follow from it: what the error of x at
  /// the end of the step makes of them. (Short time constants make it large.) What rounding of x
  /// alone would make counts for nothing here: shorter steps do not help. It is left in
  /// `unattainable`. `dxdt` is x' at (end, x) where the stepper knows it, or none.
  ///
  /// Implicit stages that hold psi = 0 have errors along that, and so has x once it is projected.
  double checkAccelerations(const Stepper& stepper, const StepNode& from, double end,
                            const State& x, const State* dxdt) {
    if (!integrates_torque_) {
      unattainable_ = 0.0;
      const double h = end - from.time;
      const State& error = stepper.error();
      State here(x.size());
      if (dxdt != nullptr) {
        here = *dxdt;
      } else {
        system_(x, here, end);
      }
      State beside(x.size());
      for (int n = 0; n < x.size(); ++n) beside[n] = x[n] + error[n];
      if (stepper.keepsConstraints() && system_.keepsConstraintsInStages()) {
        StepProjection projection(x.size());
        projection.result = projectStiffly(system_, stepper, end, h, beside, projection);
        if (projection.result != ProjectionResult::kConverged) {
          return std::numeric_limits<double>::quiet_NaN();
        }
      }
      round(x, beside);
      State change(x.size());
      calcChange(end, beside, here, change);
      double stability = 0.0;
      if (!stepper.isImplicit()) {
        if (isUnstable(h, x, beside, change)) stability = kUnstable;
      } else if (stepper.keepsConstraints() && isOnSlowMotion(h, x, beside, change)) {
        stability = checkFirstSlope(stepper, from, end);
        // A step that is refused for it need not be judged further; one of fixed size stays.
        if (!(stability <= 1.0) && !are_steps_fixed_) return stability;
      }
      double norm = stability;
      for (int n = S; n < x.size(); ++n) {
        norm = worseOf(norm, kCaution * change[n] / tolerance_.of(here[n]));
      }
      if (norm <= 1.0) return norm;  // the usual case: rounding included
      State rounded = x;
      State uncertain(x.size());
      round(x, rounded);
      calcChange(end, rounded, here, uncertain);
      norm = stability;
      for (int n = S; n < x.size(); ++n) {
        const double part = kCaution * (change[n] - uncertain[n]) / tolerance_.of(here[n]);
        norm = worseOf(norm, part);
        const double largest = std::max(largest_acceleration_[n - S], std::abs(here[n]));
        unattainable_ = worseOf(unattainable_, uncertain[n] / tolerance_.of(largest));
      }
      return norm;
    }
    return 0.0;
  }
  /// What four roundings of the state make of accelerations that follow from it, in tolerances, as
  /// the last checkAccelerations found it; 0 where it had no need to know.
  double unattainable() const { return unattainable_; }
  /// True when that is too much: accelerations are not known to the tolerance, whatever the steps.
  /// (Errors of a step up to rounding are ignored, and some of them add up.)
  bool isToleranceLost() const { return unattainable_ > kAttainable; }

 private:
  /// The view of a node whose accelerations are known and no state.
  StateView viewDerived(const StepNode& node) {
    return drivetrain_.view(node.time, node.x.data(), node.x.data() + S, node.dxdt.data() + S);
  }
  void calcTorque(StepNode& node) {
    if (integrates_torque_) {
      drivetrain_.calcTorque(system_.view(node.time, node.x), node.torque.data());
    } else {
      drivetrain_.calcTorque(viewDerived(node), node.torque.data());
    }
  }
  double inertiaOf(int i) const { return drivetrain_.inertia().entry(i, i); }

  /// The error of acceleration i that is allowed in a step, times its inertia, N m.
  double calcAllowed(const StepNode& from, const StepNode& to, int i) const {
    const double torque = std::max(std::abs(to.torque[i]), std::abs(from.torque[i]));
    const double epsilon = std::max(std::abs(to.x[2 * S + i]), std::abs(from.x[2 * S + i]));
    return std::max(inertiaOf(i) * tolerance_.of(epsilon), tolerance_.relative * torque);
  }
  /// What rounding of each angle and velocity at `to` makes of Q (`uncertain`, N m), and what the
  /// allowed errors of the accelerations do, by way of the velocities (`answer`, N m).
  void calcAnswers(const StepNode& from, const StepNode& to, ShaftVector& uncertain,
                   ShaftVector& answer) {
    constexpr double kUlps = 16.0 * std::numeric_limits<double>::epsilon();
    State shifted = to.x;
    double torque[kMaxShafts];
    const auto addChange = [&](int n, double shift, ShaftVector& sum) {
      shifted[n] = to.x[n] + shift;
      drivetrain_.calcTorque(system_.view(to.time, shifted), torque);
      shifted[n] = to.x[n];
      for (int i = 0; i < S; ++i) sum[i] += std::abs(torque[i] - to.torque[i]);
    };
    const double h = to.time - from.time;
    for (int n = 0; n < 2 * S; ++n) addChange(n, kUlps * to.x[n], uncertain);
    addTimeNoise(to, uncertain);
    for (int i = 0; i < S; ++i) {
      addChange(S + i, h * calcAllowed(from, to, i) / inertiaOf(i), answer);
    }
    system_.view(to.time, to.x);
  }
  /// What rounding inside the laws' formulas of the time makes of Q (sin(t + 1e8) knows its
  /// argument to 1e-8): how far Q is from smooth over times that are next to nothing.
  void addTimeNoise(const StepNode& to, ShaftVector& uncertain) {
    if (!drivetrain_.torquesReadTime()) return;
    constexpr double kSpan = 1e-7;  // s
    constexpr double kMost = 1e-6;  // of the largest Q
    double middle[kMaxShafts];
    double before[kMaxShafts];
    double after[kMaxShafts];
    const auto torqueAt = [&](double time, double* torque) {
      drivetrain_.calcTorque(system_.view(time, to.x), torque);
    };
    torqueAt(to.time, middle);
    for (const double part : {1.0, 0.618, 0.382, 0.236}) {
      torqueAt(to.time - part * kSpan, before);
      torqueAt(to.time + part * kSpan, after);
      for (int i = 0; i < S; ++i) {
        const double bend = std::abs(after[i] - 2.0 * middle[i] + before[i]);
        uncertain[i] = std::max(uncertain[i], std::min(2.0 * bend, kMost * largest_torque_[i]));
      }
    }
  }
  /// The size of d, see checkTorque, when `uncertain` is left aside.
  double judgeTorque(const TorqueGain& gain, const StepNode& from, const StepNode& to,
                     const ShaftVector& uncertain, const ShaftVector& answer) const {
    const double h = to.time - from.time;
    // A law that reads the time itself knows it to a rounding.
    const double origin = drivetrain_.torquesReadTime() ? std::abs(drivetrain_.origin()) : 0.0;
    double largest = 0.0;
    for (int i = 0; i < S; ++i) {
      const double size = std::max(std::abs(to.torque[i]), std::abs(from.torque[i]));
      const double rounding = 32.0 * std::numeric_limits<double>::epsilon() *
                              (size + (h + origin + std::abs(to.time)) * gain.largest_rate[i]);
      const double d = std::abs(to.torque[i] - from.torque[i] - gain.change[i]);
      const double part = (d - rounding - uncertain[i]) / (calcAllowed(from, to, i) + answer[i]);
      largest = worseOf(largest, part);
    }
    return largest;
  }

  /// Adds some four roundings of x to y: of different sign and size, lest those of two angles
  /// cancel in their difference.
  static void round(const State& x, State& y) {
    constexpr double kUlps = 4.0 * std::numeric_limits<double>::epsilon();
    constexpr double kGolden = 0.6180339887498949;
    double turn = 0.0;  // n kGolden modulo 1
    for (int n = 0; n < y.size(); ++n) {
      turn += turn + kGolden < 1.0 ? kGolden : kGolden - 1.0;
      y[n] += (n % 2 == 0 ? kUlps : -kUlps) * (0.5 + turn) * x[n];
    }
  }
  /// |x'(y) - here| of the accelerations.
  void calcChange(double t, const State& y, const State& here, State& change) {
    system_(y, change, t);
    for (int n = S; n < y.size(); ++n) change[n] = std::abs(change[n] - here[n]);
  }

  /// True when accelerations answer to a change of the state (from x to `beside`, by `change`) so
  /// strongly that no explicit step of size h is stable. Its stages may know nothing of it where a
  /// motion lies exactly on a stiff constraint's slow one; the next rounding would grow without
  /// bound.
  bool isUnstable(double h, const State& x, const State& beside, const State& change) const {
    double moved = 0.0;
    double answer = 0.0;
    for (int n = 0; n < S; ++n) {
      moved = std::max({moved, std::abs(beside[n] - x[n]) / h, std::abs(beside[S + n] - x[S + n])});
      answer = std::max(answer, h * change[S + n]);
    }
    return answer > kMostStable * moved;
  }
  /// True when accelerations answer to a change of the velocities (from x to `beside`, by `change`)
  /// many times within a step of size h: an implicit step then follows a slow motion.
  bool isOnSlowMotion(double h, const State& x, const State& beside, const State& change) const {
    double moved = 0.0;
    double answer = 0.0;
    for (int n = S; n < 2 * S; ++n) {
      moved = std::max(moved, std::abs(beside[n] - x[n]));
      answer = std::max(answer, h * change[n]);
    }
    return answer > kSlow * moved;
  }
  /// On the slow motion of something stiff an implicit step leaves velocities of order 5, but their
  /// slopes, the accelerations, of order 3 only (the component z of index 2; Hairer, Wanner:
  /// Solving ODE II, VII.4), and its error estimate is of the velocities. How far the slope of its
  /// polynomial at its beginning is from the accelerations there measures that, one to ten times
  /// too large.
  double checkFirstSlope(const Stepper& stepper, const StepNode& from, double end) const {
    StepNode to(system_);
    to.time = end;
    State slope(to.x.size());
    stepper.calcSlope(from.time, from, to, slope);
    double norm = 0.0;
    for (int n = S; n < slope.size(); ++n) {
      const double part = std::abs(slope[n] - from.dxdt[n]) / tolerance_.of(from.dxdt[n]);
      norm = worseOf(norm, part / kFirstSlope);
    }
    return norm;
  }

  /// See isToleranceLost.
  static constexpr double kAttainable = 50.0;
  /// The |h lambda| (h^2 times a stiffness) of explicit steps is some ten at most.
  static constexpr double kMostStable = 100.0;
  /// What stands for the error of a step beyond that.
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
  PrincipleSystem& system_;
  Drivetrain& drivetrain_;  // the system's
  Tolerance tolerance_;
  bool are_steps_fixed_;
  double unattainable_ = 0.0;
  ShaftVector largest_acceleration_;  // of late, see noteAccelerations
  ShaftVector largest_torque_;        // that a step began with, N m
};

}  // namespace variator_sim
