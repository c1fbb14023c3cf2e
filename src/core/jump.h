/// The jump map: what a zero-order-hold step of the inputs does to the accelerations.
///
/// At the jump t, phi and omega are frozen and epsilon moves along psi = 0 as it would under ever
/// faster ramps: with theta from 0 to 1, u = u0 + theta (u1 - u0), Delta_Q = Q(u1) - Q(u0),
///     d epsilon / d theta = J^-1 (Delta_Q + C^T Lambda),
///     C d epsilon / d theta + dpsi/du (u1 - u0) = 0.
/// Where C depends neither on epsilon nor on an input this is one exact linear projection;
/// otherwise it is integrated with error control and projected.
///
/// Where psi has a kink in epsilon (abs, min, max of accelerations) C jumps. A step ends there, a
/// hop too short to matter leads over it, and the path goes on with the C of the other side: the
/// limit of ever less rounded kinks. Where both sides push back to the kink, that limit stays in
/// the corner; C is not one there, and the jump fails.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "drivetrain.h"
#include "least_reaction.h"
#include "projection.h"
#include "step_control.h"
#include "stepper.h"
#include "variator_sim/status.h"

namespace variator_sim {

class JumpMap {
 public:
  /// `keeps_reaction_in_range`: R stays C^T lambda along the jump (the formal equations [18])
  /// instead of changing by C^T Lambda. The same wherever C does not depend on epsilon.
  JumpMap(Drivetrain& drivetrain, const SolverSettings& settings, bool keeps_reaction_in_range)
      : S(drivetrain.shafts()),
        drivetrain_(drivetrain),
        path_(drivetrain, keeps_reaction_in_range),
        // A jump's error stays for good and adds to those of all other jumps: a tenth.
        tolerance_{0.1 * settings.absolute_tolerance,
                   std::max(0.1 * settings.relative_tolerance, 1e-14)},
        stepper_(makeStepper(StepperKind::kDop853, path_, tolerance_)),
        consistency_(drivetrain) {
    for (int m = 0; m < drivetrain.constraintCount(); ++m) {
      const Constraint& constraint = drivetrain.constraint(m);
      straight_ = straight_ && constraint.isLinearInAcceleration() &&
                  constraint.nonlinearAccelerations() == 0 && !constraint.readsInputs();
    }
  }

  /// Moves `epsilon` (S values) from inputs u0 to u1 (inputCount values) at fixed (t, phi, omega).
  /// On failure `epsilon` is unchanged and the status says why, its time excepted. [loop]
  MotionStatus apply(double t, const double* phi, const double* omega, const double* u0,
                     const double* u1, double* epsilon, std::uint64_t* projections) {
    path_.begin(t, phi, omega, u0, u1);
    return follow(epsilon, projections);
  }
  /// The same for a torque that jumps by `torque_jump` (N m, S values) while the inputs stay.
  /// [loop]
  MotionStatus applyTorque(double t, const double* phi, const double* omega,
                           const double* torque_jump, double* epsilon, std::uint64_t* projections) {
    path_.begin(t, phi, omega, drivetrain_.inputs(), drivetrain_.inputs());
    path_.setTorqueJump(torque_jump);
    return follow(epsilon, projections);
  }

 private:
  /// Moves `epsilon` along the path that was begun.
  MotionStatus follow(double* epsilon, std::uint64_t* projections) {
    State e(S);
    std::copy(epsilon, epsilon + S, e.begin());
    State rate(S);
    path_(e, rate, 0.0);
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      row_reference_[m] = drivetrain_.solver().rowLengthSquared(m);
    }
    const MotionStatus status = straight_ ? stepStraight(e, rate) : integrate(e, rate, projections);
    if (status.ok()) std::copy(e.begin(), e.end(), epsilon);
    return status;
  }

  /// d epsilon / d theta as a system that can be stepped.
  class Path final : public System {
   public:
    Path(Drivetrain& drivetrain, bool formal)
        : System(drivetrain.shafts(), 1, false), drivetrain_(drivetrain), formal_(formal) {}
    void begin(double t, const double* phi, const double* omega, const double* u0,
               const double* u1) {
      // The rates are those of the inputs that do not jump: f' of a constraint of order 1 reads the
      // rates of its own.
      state_ = {
          t, phi, omega, nullptr, input_, drivetrain_.inputRates(), drivetrain_.inputSecondRates()};
      const int n = drivetrain_.inputCount();
      double before[kMaxShafts];
      for (int i = 0; i < n; ++i) {
        start_[i] = input_[i] = u0[i];
        jump_[i] = u1[i] - u0[i];
      }
      drivetrain_.calcTorque(state_, before);
      for (int i = 0; i < n; ++i) input_[i] = u1[i];
      drivetrain_.calcTorque(state_, torque_jump_);
      for (int i = 0; i < S; ++i) torque_jump_[i] -= before[i];
    }
    void setTorqueJump(const double* jump) { std::copy_n(jump, S, torque_jump_); }
    StateView at(double theta, const double* e) {
      for (int i = 0; i < drivetrain_.inputCount(); ++i) input_[i] = start_[i] + theta * jump_[i];
      StateView state = state_;
      state.acceleration = e;
      return state;
    }
    void operator()(const State& e, State& rate, double theta) override {
      if (formal_) {
        drivetrain_.calcFormalJumpRate(at(theta, e.data()), torque_jump_, jump_, rate.data());
      } else {
        drivetrain_.calcJumpRate(at(theta, e.data()), torque_jump_, jump_, rate.data());
      }
    }

   private:
    Drivetrain& drivetrain_;
    bool formal_;
    StateView state_{};
    double start_[kMaxInputs] = {};
    double jump_[kMaxInputs] = {};
    double input_[kMaxInputs] = {};
    double torque_jump_[kMaxShafts] = {};
  };

  MotionStatus stepStraight(State& e, const State& rate) {
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(rate[i])) return explain(e, 0.0);
      e[i] += rate[i];
    }
    return {};
  }

  MotionStatus integrate(State& e, State& rate, std::uint64_t* projections) {
    constexpr int kMaxSteps = 100000;
    StepControl control(stepper_->errorOrder());
    control.reset();
    double theta = 0.0;
    double h = 0.1;
    double usual = h;  // but for kinks
    bool rejected = false;
    calcKinks(e, 0.0, kinks_);
    if (liesOnKink(e) && !hop(&theta, e, rate, kShortest, projections)) return explain(e, theta);
    // Of steps from here, one of `beyond` passes a kink; those that do not are this much shorter.
    double beyond = std::numeric_limits<double>::infinity();
    for (int step = 0; step < kMaxSteps; ++step) {
      h = std::min(h, 1.0 - theta);
      State e_new(S);
      const double norm = tryStep(theta, e, rate, h, e_new, projections);
      if (norm <= 1.0 && passesKink(e_new, theta + h)) {
        // Halve the way to the kink; the last step before it is as long as a hop.
        beyond = h;
        const double resolution = std::max(kKinkResolution * tolerance_.relative, kShortest);
        if (beyond > resolution) {
          h = 0.5 * beyond;
          continue;
        }
        if (!hop(&theta, e, rate, beyond, projections)) return explain(e, theta);
        if (theta >= 1.0) return finish(e, theta);
        h = usual;
        beyond = std::numeric_limits<double>::infinity();
        rejected = false;
        control.reset();
        continue;
      }
      if (norm <= 1.0) {
        theta += h;
        e = e_new;
        if (theta >= 1.0) return finish(e, theta);
        calcKinks(e, theta, kinks_);
        path_(e, rate, theta);
        const double factor = control.growth(norm);
        beyond -= h;
        if (!(beyond > kShortest)) beyond = std::numeric_limits<double>::infinity();
        if (std::isfinite(beyond)) {
          h = std::max(0.5 * beyond, kShortest);
        } else {
          h *= rejected ? std::min(1.0, factor) : factor;
          usual = h;
        }
        rejected = false;
      } else {
        h *= control.shrink(norm);
        rejected = true;
        if (!(h > kShortest)) return explain(e, theta);
      }
    }
    return explain(e, theta);
  }

  /// A step of h, projected; its error in units of the tolerance.
  double tryStep(double theta, const State& e, const State& rate, double h, State& e_new,
                 std::uint64_t* projections) {
    State rate_new(S);
    State moved(S);
    const double norm = stepper_->step(path_, StepNode(theta, e, rate), h, e_new, rate_new);
    if (!(norm <= 1.0)) return norm;
    const auto projected = projectAccelerations(drivetrain_, path_.at(theta + h, e_new.data()),
                                                e_new.data(), moved.data(), projections);
    // What the projection had to move is a second, independent measure of the error.
    return projected == ProjectionResult::kConverged
               ? worseOf(norm, calcErrorNorm(moved, e, e_new, tolerance_))
               : std::numeric_limits<double>::quiet_NaN();
  }

  /// The end, if psi is zero there.
  MotionStatus finish(const State& e, double theta) {
    if (drivetrain_.hasAccelerationRows() &&
        !consistency_.isConsistent(path_.at(theta, e.data()))) {
      return explain(e, theta);
    }
    return {};
  }

  // --- kinks -----------------------------------------------------------------------------------
  static constexpr std::size_t kMostKinks = Drivetrain::kMostKinks;

  void calcKinks(const State& e, double theta, double* values) {
    const auto& kinks = drivetrain_.kinks();
    if (kinks.empty()) return;
    const StateView state = path_.at(theta, e.data());
    for (std::size_t j = 0; j < kinks.size(); ++j) values[j] = kinks[j]->calcResidual(state);
  }
  /// True when e_new is on the other side of a kink than the path (kinks_).
  bool passesKink(const State& e_new, double theta) {
    double values[kMostKinks];
    calcKinks(e_new, theta, values);
    for (std::size_t j = 0; j < drivetrain_.kinks().size(); ++j) {
      if ((kinks_[j] > 0.0 && values[j] < 0.0) || (kinks_[j] < 0.0 && values[j] > 0.0)) return true;
    }
    return false;
  }
  bool liesOnKink(const State& e) const {
    double size = 0.0;
    for (double value : e) size = std::max(size, std::abs(value));
    for (std::size_t j = 0; j < drivetrain_.kinks().size(); ++j) {
      if (std::abs(kinks_[j]) <= 16.0 * std::numeric_limits<double>::epsilon() * size) return true;
    }
    return false;
  }
  /// Goes on by `length` with the present rate, over the kinks that are met, and takes the rate
  /// there. False when that one leads back over a kink.
  bool hop(double* theta, State& e, State& rate, double length, std::uint64_t* projections) {
    const std::size_t count = drivetrain_.kinks().size();
    const double end = std::min(1.0, *theta + length);
    double before[kMostKinks];
    double beyond[kMostKinks];
    std::copy_n(kinks_, count, before);
    State there = e;
    double stretch = 2.0 * length;
    for (int n = 0; n < 10; ++n, stretch *= 4.0) {
      // Until rounding does not hide on which side it ends.
      for (int i = 0; i < S; ++i) there[i] = e[i] + stretch * rate[i];
      if (!liesOnKinkAt(there, end)) break;
    }
    std::copy_n(kinks_, count, beyond);
    State rate_there(S);
    path_(there, rate_there, end);
    // To the kink with the rate before it, then with the one behind it.
    double part = 1.0;
    for (std::size_t j = 0; j < count; ++j) {
      if (before[j] * beyond[j] <= 0.0 && before[j] != beyond[j]) {
        part = std::min(part, before[j] / (before[j] - beyond[j]));
      }
    }
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(rate_there[i])) return false;
      there[i] = e[i] + stretch * (part * rate[i] + (1.0 - part) * rate_there[i]);
    }
    State moved(S);
    if (projectAccelerations(drivetrain_, path_.at(end, there.data()), there.data(), moved.data(),
                             projections) != ProjectionResult::kConverged) {
      return false;
    }
    path_(there, rate_there, end);
    double ahead_values[kMostKinks];
    State ahead(S);
    double size = 0.0;
    double speed = 0.0;
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(rate_there[i])) return false;
      size = std::max(size, std::abs(there[i] - e[i]));
      speed = std::max(speed, std::abs(rate_there[i]));
    }
    calcKinks(there, end, kinks_);
    for (std::size_t j = 0; j < count; ++j) {
      if (kinks_[j] * beyond[j] < 0.0) return false;
    }
    if (speed > 0.0) {
      for (int i = 0; i < S; ++i) ahead[i] = there[i] + 4.0 * size / speed * rate_there[i];
      calcKinks(ahead, end, ahead_values);
      for (std::size_t j = 0; j < count; ++j) {
        if (kinks_[j] * ahead_values[j] < 0.0) return false;
      }
    }
    *theta = end;
    e = there;
    rate = rate_there;
    return true;
  }
  bool liesOnKinkAt(const State& e, double theta) {
    calcKinks(e, theta, kinks_);
    return liesOnKink(e);
  }

  /// Why the path ends at (theta, e).
  MotionStatus explain(const State& e, double theta) {
    MotionStatus status;
    const StateView state = path_.at(theta, e.data());
    if (drivetrain_.findNonFinite(state, &status.torque, &status.constraint)) {
      status.reason = StopReason::kNonFiniteValue;
      return status;
    }
    status.reason = StopReason::kJumpFailed;
    State rate(S);
    const double nothing[kMaxInputs > kMaxShafts ? kMaxInputs : kMaxShafts] = {};
    if (!drivetrain_.calcJumpRate(state, nothing, nothing, rate.data())) {
      status.reason = StopReason::kSingularConstraint;
      status.constraint = drivetrain_.solver().singularRow();
      status.measure = drivetrain_.solver().singularMeasure();
      return status;
    }
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      const double left = std::sqrt(drivetrain_.solver().rowLengthSquared(m) / row_reference_[m]);
      if (left < kNearlyVanished) {
        status.reason = StopReason::kSingularConstraint;
        status.constraint = m;
        status.measure = left;
      }
    }
    return status;
  }

  /// A path that ends where C is this part of what it was ends because of it: C goes to zero there
  /// like a root of the distance, and the step underflows first.
  static constexpr double kNearlyVanished = 1e-4;
  /// No step is shorter.
  static constexpr double kShortest = 1e-14;
  /// A hop over a kink is as long as this part of the tolerance.
  static constexpr double kKinkResolution = 0.1;

  const int S;  // shafts
  Drivetrain& drivetrain_;
  Path path_;
  Tolerance tolerance_;
  std::unique_ptr<Stepper> stepper_;
  LeastReactionSolver consistency_;
  bool straight_ = true;
  double kinks_[kMostKinks] = {};  // at the path's present place
  double row_reference_[kMaxRows] = {};
};

}  // namespace variator_sim
