/// The jump map: what a zero-order-hold step of the inputs does to the accelerations.
///
/// At the jump t, phi and omega are frozen and epsilon moves along psi = 0 as it would under ever
/// faster ramps: with theta from 0 to 1, u = u0 + theta (u1 - u0), Delta_Q = Q(u1) - Q(u0),
///     d epsilon / d theta = J^-1 (Delta_Q + C^T Lambda),
///     C d epsilon / d theta + dpsi/du (u1 - u0) = 0.
/// Where C depends neither on epsilon nor on an input this is one exact linear projection;
/// otherwise it is integrated with error control and projected.
#pragma once

#include <array>
#include <cmath>

#include "drivetrain.h"
#include "explicit_stepper.h"
#include "projection.h"
#include "step_control.h"
#include "variator_sim/status.h"

namespace variator_sim {

template <class Shape>
class JumpMap {
  static constexpr int S = Shape::kShafts;

 public:
  /// `keeps_reaction_in_range`: R stays C^T lambda along the jump (the formal equations [18])
  /// instead of changing by C^T Lambda. The same wherever C does not depend on epsilon.
  JumpMap(Drivetrain<Shape>& drivetrain, const SolverSettings& settings,
          bool keeps_reaction_in_range)
      : drivetrain_(drivetrain),
        path_(drivetrain, keeps_reaction_in_range),
        // A jump's error stays for good and adds to those of all other jumps: a tenth.
        tolerance_{0.1 * settings.absolute_tolerance,
                   std::max(0.1 * settings.relative_tolerance, 1e-14)},
        stepper_(tolerance_) {
    for (int m = 0; m < drivetrain.constraintCount(); ++m) {
      const Constraint& constraint = drivetrain.constraint(m);
      straight_ = straight_ && constraint.isLinearInAcceleration() && !constraint.readsInputs();
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
  using Vector = std::array<double, S>;

  /// Moves `epsilon` along the path that was begun.
  MotionStatus follow(double* epsilon, std::uint64_t* projections) {
    Vector e;
    std::copy(epsilon, epsilon + S, e.begin());
    Vector rate;
    path_(e, rate, 0.0);
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      row_reference_[m] = drivetrain_.solver().rowLengthSquared(m);
    }
    const MotionStatus status = straight_ ? stepStraight(e, rate) : integrate(e, rate, projections);
    if (status.ok()) std::copy(e.begin(), e.end(), epsilon);
    return status;
  }

  /// d epsilon / d theta as a system that Boost.Odeint can step.
  class Path {
   public:
    static constexpr int kShafts = S;
    using State = Vector;
    Path(Drivetrain<Shape>& drivetrain, bool formal) : drivetrain_(drivetrain), formal_(formal) {}
    void begin(double t, const double* phi, const double* omega, const double* u0,
               const double* u1) {
      // The rates are those of the inputs that do not jump: f' of a constraint of order 1 reads the
      // rates of its own.
      state_ = {
          t, phi, omega, nullptr, input_, drivetrain_.inputRates(), drivetrain_.inputSecondRates()};
      const int n = drivetrain_.inputCount();
      double before[S];
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
    [[gnu::noinline]] void operator()(const Vector& e, Vector& rate, double theta) {
      if (formal_) {
        drivetrain_.calcFormalJumpRate(at(theta, e.data()), torque_jump_, jump_, rate.data());
      } else {
        drivetrain_.calcJumpRate(at(theta, e.data()), torque_jump_, jump_, rate.data());
      }
    }

   private:
    Drivetrain<Shape>& drivetrain_;
    bool formal_;
    StateView state_{};
    double start_[kMaxInputs] = {};
    double jump_[kMaxInputs] = {};
    double input_[kMaxInputs] = {};
    double torque_jump_[S] = {};
  };

  MotionStatus stepStraight(Vector& e, const Vector& rate) {
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(rate[i])) return explain(e, 0.0);
      e[i] += rate[i];
    }
    return {};
  }

  MotionStatus integrate(Vector& e, Vector& rate, std::uint64_t* projections) {
    constexpr int kMaxSteps = 100000;
    StepControl control(stepper_.errorOrder());
    control.reset();
    double theta = 0.0;
    double h = 0.1;
    bool rejected = false;
    for (int step = 0; step < kMaxSteps; ++step) {
      h = std::min(h, 1.0 - theta);
      Vector e_new;
      Vector rate_new;
      Vector moved;
      double norm = stepper_.step(path_, {theta, e, rate}, h, e_new, rate_new);
      if (norm <= 1.0) {
        const auto projected = projectAccelerations(drivetrain_, path_.at(theta + h, e_new.data()),
                                                    e_new.data(), moved.data(), projections);
        // What the projection had to move is a second, independent measure of the error.
        norm = projected == ProjectionResult::kConverged
                   ? worseOf(norm, calcErrorNorm(moved, e, e_new, tolerance_))
                   : std::numeric_limits<double>::quiet_NaN();
      }
      if (norm <= 1.0) {
        theta += h;
        e = e_new;
        if (theta >= 1.0) return {};
        path_(e, rate, theta);
        const double factor = control.growth(norm);
        h *= rejected ? std::min(1.0, factor) : factor;
        rejected = false;
      } else {
        h *= control.shrink(norm);
        rejected = true;
        if (!(h > 1e-14)) return explain(e, theta);
      }
    }
    return explain(e, theta);
  }

  /// Why the path ends at (theta, e).
  MotionStatus explain(const Vector& e, double theta) {
    MotionStatus status;
    const StateView state = path_.at(theta, e.data());
    if (drivetrain_.findNonFinite(state, &status.torque, &status.constraint)) {
      status.reason = StopReason::kNonFiniteValue;
      return status;
    }
    status.reason = StopReason::kJumpFailed;
    Vector rate;
    const double nothing[kMaxInputs > S ? kMaxInputs : S] = {};
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

  Drivetrain<Shape>& drivetrain_;
  Path path_;
  Tolerance tolerance_;
  ExplicitStepper<Dop853Tableau, Path, 0> stepper_;
  bool straight_ = true;
  double row_reference_[Drivetrain<Shape>::kMaxRows] = {};
};

}  // namespace variator_sim
