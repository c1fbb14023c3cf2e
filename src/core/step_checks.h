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
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "projection.h"
#include "step_control.h"
#include "stepper.h"

namespace variator_sim {

/// Projects x, which a step of size h by `stepper` has reached at t, as that stepper's states need
/// it; `slope` is x' of its polynomial there (of a stepper that keeps constraints).
template <class System>
ProjectionResult projectStiffly(System& system, const Stepper<System>& stepper, double t, double h,
                                const typename System::State& slope, typename System::State& x,
                                typename System::State& moved, std::uint64_t* iterations) {
  // Accelerations that are no state are the slope's; without one there is nothing stiff to do.
  return kIntegratesTorque<System> || stepper.keepsConstraints()
             ? system.projectStiffly(t, h, slope, x, moved, iterations)
             : system.project(t, x, moved, iterations);
}
/// The same at the end of the stepper's last step.
template <class System>
ProjectionResult projectStiffly(System& system, const Stepper<System>& stepper, double end,
                                double h, typename System::State& x,
                                StepProjection<typename System::State>& projection) {
  StepNode<System> from;
  StepNode<System> to;
  from.time = end - h;
  to.time = end;
  typename System::State slope{};
  if (stepper.keepsConstraints()) stepper.calcSlope(end, from, to, slope);
  return projectStiffly(system, stepper, end, h, slope, x, projection.moved,
                        &projection.iterations);
}

/// The checks of the steps of one motion. Norms are in units of the tolerance, and a step is good
/// at most 1. All are [loop].
template <class System>
class StepChecks {
 public:
  static constexpr int S = System::kShafts;
  using State = typename System::State;
  using Node = StepNode<System>;

  /// `system` has to outlive this. `are_steps_fixed`: errors are told and refuse no step.
  StepChecks(System& system, Tolerance tolerance, bool are_steps_fixed)
      : system_(system),
        drivetrain_(system.drivetrain()),
        tolerance_(tolerance),
        are_steps_fixed_(are_steps_fixed) {}

  /// Forgets what belongs to a motion.
  void reset() {
    largest_acceleration_.fill(0.0);
    largest_torque_.fill(0.0);
  }

  /// Writes Q and Q' of `node`, whose derivative is known and is the last that was taken.
  void noteTorque(Node& node) {
    calcTorque(node);
    noteTorqueRate(node);
    if constexpr (!kIntegratesTorque<System>) {
      drivetrain_.calcTorqueRate(viewDerived(node), node.torque_rate.data());
    }
  }
  /// Q' alone, where the derivative has it.
  void noteTorqueRate(Node& node) {
    if constexpr (kIntegratesTorque<System>) {
      std::copy_n(system_.torqueRate(), S, node.torque_rate.begin());
    }
  }
  /// How large accelerations that follow from the state have been lately: what a transient has left
  /// long ago says nothing of now, but they may well be zero for a moment.
  void noteAccelerations(const Node& node) {
    if constexpr (!kIntegratesTorque<System>) {
      const double memory = tolerance_.absolute > 0.0 ? 0.9 : 1.0;
      for (std::size_t i = 0; i < S; ++i) {
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
  double checkTorque(Stepper<System>& stepper, const Node& from, Node& to) {
    if constexpr (kIntegratesTorque<System>) {
      if (!drivetrain_.hasTorques()) return 0.0;
      for (std::size_t i = 0; i < S; ++i) {
        largest_torque_[i] = std::max(largest_torque_[i], std::abs(from.torque[i]));
      }
      calcTorque(to);
      TorqueGain<System> gain;
      stepper.calcTorqueGain(system_, from, to, gain);
      const double strict = judgeTorque(gain, from, to, Torque{}, Torque{});
      if (strict <= 1.0 || strict != strict) return strict;
      Torque uncertain{};
      Torque answer{};
      calcAnswers(from, to, uncertain, answer);
      return judgeTorque(gain, from, to, uncertain, answer);
    }
    return 0.0;
  }

  /// The counterpart of checkTorque where the torques make the accelerations themselves: an
  /// explicit step of controlled size may not pass over a narrow layer of Q. Its ends tell: false
  /// where Q changes by much that the rates there (trapezoidal rule) do not explain, and a velocity
  /// could err by that. Writes Q and Q' at `to`, whose derivative is known.
  bool isTorqueFollowed(const Stepper<System>& stepper, const Node& from, Node& to) {
    if constexpr (!kIntegratesTorque<System>) {
      if (!drivetrain_.hasTorques() || are_steps_fixed_) return true;
      noteTorque(to);
      if (stepper.isImplicit()) return true;
      const double h = to.time - from.time;
      for (std::size_t i = 0; i < S; ++i) {
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
  double checkAccelerations(const Stepper<System>& stepper, const Node& from, double end,
                            const State& x, const State* dxdt) {
    if constexpr (!kIntegratesTorque<System>) {
      unattainable_ = 0.0;
      const double h = end - from.time;
      const State& error = stepper.error();
      State here;
      if (dxdt != nullptr) {
        here = *dxdt;
      } else {
        system_(x, here, end);
      }
      State beside;
      for (std::size_t n = 0; n < x.size(); ++n) beside[n] = x[n] + error[n];
      if (stepper.keepsConstraints() && system_.keepsConstraintsInStages()) {
        StepProjection<State> projection;
        projection.result = projectStiffly(system_, stepper, end, h, beside, projection);
        if (projection.result != ProjectionResult::kConverged) {
          return std::numeric_limits<double>::quiet_NaN();
        }
      }
      round(x, beside);
      State change;
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
      for (std::size_t n = S; n < x.size(); ++n) {
        norm = worseOf(norm, kCaution * change[n] / tolerance_.of(here[n]));
      }
      if (norm <= 1.0) return norm;  // the usual case: rounding included
      State rounded = x;
      State uncertain;
      round(x, rounded);
      calcChange(end, rounded, here, uncertain);
      norm = stability;
      for (std::size_t n = S; n < x.size(); ++n) {
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
  using Torque = typename Node::Torque;

  /// The view of a node whose accelerations are known and no state.
  StateView viewDerived(const Node& node) {
    return drivetrain_.view(node.time, node.x.data(), node.x.data() + S, node.dxdt.data() + S);
  }
  void calcTorque(Node& node) {
    if constexpr (kIntegratesTorque<System>) {
      drivetrain_.calcTorque(system_.view(node.time, node.x), node.torque.data());
    } else {
      drivetrain_.calcTorque(viewDerived(node), node.torque.data());
    }
  }
  double inertiaOf(std::size_t i) const {
    return drivetrain_.inertia().entry(static_cast<int>(i), static_cast<int>(i));
  }

  /// The error of acceleration i that is allowed in a step, times its inertia, N m.
  double calcAllowed(const Node& from, const Node& to, std::size_t i) const {
    const double torque = std::max(std::abs(to.torque[i]), std::abs(from.torque[i]));
    const double epsilon = std::max(std::abs(to.x[2 * S + i]), std::abs(from.x[2 * S + i]));
    return std::max(inertiaOf(i) * tolerance_.of(epsilon), tolerance_.relative * torque);
  }
  /// What rounding of each angle and velocity at `to` makes of Q (`uncertain`, N m), and what the
  /// allowed errors of the accelerations do, by way of the velocities (`answer`, N m).
  void calcAnswers(const Node& from, const Node& to, Torque& uncertain, Torque& answer) {
    constexpr double kUlps = 16.0 * std::numeric_limits<double>::epsilon();
    State shifted = to.x;
    double torque[S];
    const auto addChange = [&](std::size_t n, double shift, Torque& sum) {
      shifted[n] = to.x[n] + shift;
      drivetrain_.calcTorque(system_.view(to.time, shifted), torque);
      shifted[n] = to.x[n];
      for (std::size_t i = 0; i < S; ++i) sum[i] += std::abs(torque[i] - to.torque[i]);
    };
    const double h = to.time - from.time;
    for (std::size_t n = 0; n < 2 * S; ++n) addChange(n, kUlps * to.x[n], uncertain);
    addTimeNoise(to, uncertain);
    for (std::size_t i = 0; i < S; ++i) {
      addChange(S + i, h * calcAllowed(from, to, i) / inertiaOf(i), answer);
    }
    system_.view(to.time, to.x);
  }
  /// What rounding inside the laws' formulas of the time makes of Q (sin(t + 1e8) knows its
  /// argument to 1e-8): how far Q is from smooth over times that are next to nothing.
  void addTimeNoise(const Node& to, Torque& uncertain) {
    if (!drivetrain_.torquesReadTime()) return;
    constexpr double kSpan = 1e-7;  // s
    constexpr double kMost = 1e-6;  // of the largest Q
    double middle[S];
    double before[S];
    double after[S];
    const auto torqueAt = [&](double time, double* torque) {
      drivetrain_.calcTorque(system_.view(time, to.x), torque);
    };
    torqueAt(to.time, middle);
    for (const double part : {1.0, 0.618, 0.382, 0.236}) {
      torqueAt(to.time - part * kSpan, before);
      torqueAt(to.time + part * kSpan, after);
      for (std::size_t i = 0; i < S; ++i) {
        const double bend = std::abs(after[i] - 2.0 * middle[i] + before[i]);
        uncertain[i] = std::max(uncertain[i], std::min(2.0 * bend, kMost * largest_torque_[i]));
      }
    }
  }
  /// The size of d, see checkTorque, when `uncertain` is left aside.
  double judgeTorque(const TorqueGain<System>& gain, const Node& from, const Node& to,
                     const Torque& uncertain, const Torque& answer) const {
    const double h = to.time - from.time;
    // A law that reads the time itself knows it to a rounding.
    const double origin = drivetrain_.torquesReadTime() ? std::abs(drivetrain_.origin()) : 0.0;
    double largest = 0.0;
    for (std::size_t i = 0; i < S; ++i) {
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
    for (std::size_t n = 0; n < y.size(); ++n) {
      turn += turn + kGolden < 1.0 ? kGolden : kGolden - 1.0;
      y[n] += (n % 2 == 0 ? kUlps : -kUlps) * (0.5 + turn) * x[n];
    }
  }
  /// |x'(y) - here| of the accelerations.
  void calcChange(double t, const State& y, const State& here, State& change) {
    system_(y, change, t);
    for (std::size_t n = S; n < y.size(); ++n) change[n] = std::abs(change[n] - here[n]);
  }

  /// True when accelerations answer to a change of the state (from x to `beside`, by `change`) so
  /// strongly that no explicit step of size h is stable. Its stages may know nothing of it where a
  /// motion lies exactly on a stiff constraint's slow one; the next rounding would grow without
  /// bound.
  static bool isUnstable(double h, const State& x, const State& beside, const State& change) {
    double moved = 0.0;
    double answer = 0.0;
    for (std::size_t n = 0; n < S; ++n) {
      moved = std::max({moved, std::abs(beside[n] - x[n]) / h, std::abs(beside[S + n] - x[S + n])});
      answer = std::max(answer, h * change[S + n]);
    }
    return answer > kMostStable * moved;
  }
  /// True when accelerations answer to a change of the velocities (from x to `beside`, by `change`)
  /// many times within a step of size h: an implicit step then follows a slow motion.
  static bool isOnSlowMotion(double h, const State& x, const State& beside, const State& change) {
    double moved = 0.0;
    double answer = 0.0;
    for (std::size_t n = S; n < 2 * S; ++n) {
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
  double checkFirstSlope(const Stepper<System>& stepper, const Node& from, double end) const {
    Node to;
    to.time = end;
    State slope;
    stepper.calcSlope(from.time, from, to, slope);
    double norm = 0.0;
    for (std::size_t n = S; n < slope.size(); ++n) {
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

  System& system_;
  typename System::DrivetrainType& drivetrain_;  // the system's
  Tolerance tolerance_;
  bool are_steps_fixed_;
  double unattainable_ = 0.0;
  std::array<double, S> largest_acceleration_{};  // of late, see noteAccelerations
  typename Node::Torque largest_torque_{};        // that a step began with, N m
};

}  // namespace variator_sim
