/// The jump map: what a zero-order-hold step of the inputs does to the accelerations.
///
/// At the jump t, phi and omega are frozen and epsilon moves along psi = 0 as it would under ever
/// faster ramps: with theta from 0 to 1, u = u0 + theta (u1 - u0), Delta_Q = Q(u1) - Q(u0),
///     d epsilon / d theta = J^-1 (Delta_Q + C^T Lambda),
///     C d epsilon / d theta + dpsi/du (u1 - u0) = 0.
/// If C depends neither on epsilon nor on an input, this is one exact linear projection;
/// otherwise it is integrated with error control and projected.
///
/// At a kink of psi in epsilon (abs, min, max of accelerations) C jumps. A step ends there, a
/// hop too short to matter leads over it, and the path goes on with the C of the other side: the
/// limit of ever less rounded kinks. If both sides push back to the kink, that limit stays in
/// the corner; C is not one there, and the jump fails.
#pragma once

#include <algorithm>
#include <memory>

#include "dynamics/least_reaction.h"
#include "dynamics/projection.h"
#include "dynamics/system.h"
#include "integrate/step_control.h"
#include "integrate/stepper.h"
#include "variator_sim/status.h"

namespace variator_sim {

class JumpMap {
 public:
  /// `system` has to outlive this.
  JumpMap(System& system, const SolverSettings& settings);

  /// Moves the accelerations of x, those that follow from it included, from inputs u0 to u1
  /// (inputCount values) at fixed (t, phi, omega). On failure x is unchanged and the status says
  /// why, its time excepted. [loop]
  MotionStatus apply(double t, State& x, const double* u0, const double* u1,
                     std::uint64_t* projections);
  /// The same for a torque that jumps by `torque_jump` (N m, S values) while the inputs stay.
  /// [loop]
  MotionStatus applyTorque(double t, State& x, const double* torque_jump,
                           std::uint64_t* projections);

 private:
  /// Moves `epsilon` along the path that was begun.
  MotionStatus follow(double* epsilon, std::uint64_t* projections);

  /// d epsilon / d theta, the slope of a path.
  class Path {
   public:
    Path(Drivetrain& drivetrain, bool formal)
        : S(drivetrain.shafts()), drivetrain_(drivetrain), formal_(formal) {}
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
    void operator()(const State& e, State& rate, double theta) {
      if (formal_) {
        drivetrain_.calcFormalJumpRate(at(theta, e.data()), torque_jump_, jump_, rate.data());
      } else {
        drivetrain_.calcJumpRate(at(theta, e.data()), torque_jump_, jump_, rate.data());
      }
    }

   private:
    const int S;  // shafts
    Drivetrain& drivetrain_;
    bool formal_;
    StateView state_{};
    double start_[kMaxInputs] = {};
    double jump_[kMaxInputs] = {};
    double input_[kMaxInputs] = {};
    double torque_jump_[kMaxShafts] = {};
  };

  MotionStatus stepStraight(State& e, const State& rate);

  MotionStatus integrate(State& e, State& rate, std::uint64_t* projections);

  /// A step of h, projected; its error in units of the tolerance.
  double tryStep(double theta, const State& e, const State& rate, double h, State& e_new,
                 std::uint64_t* projections);

  /// The end, if psi is zero there.
  MotionStatus finish(const State& e, double theta);

  // --- kinks -----------------------------------------------------------------------------------
  static constexpr std::size_t kMostKinks = Drivetrain::kMostKinks;

  void calcKinks(const State& e, double theta, double* values);
  /// True when e_new is on the other side of a kink than the path (kinks_).
  bool passesKink(const State& e_new, double theta);
  bool liesOnKink(const State& e) const;
  /// Goes on by `length` with the present rate, over the kinks that are met, and takes the rate
  /// there. False when that one leads back over a kink.
  bool hop(double* theta, State& e, State& rate, double length, std::uint64_t* projections);
  bool liesOnKinkAt(const State& e, double theta);

  /// Why the path ends at (theta, e).
  MotionStatus explain(const State& e, double theta);

  /// A path that ends where C is this part of what it was ends because of it: C goes to zero there
  /// like a root of the distance, and the step underflows first.
  static constexpr double kNearlyVanished = 1e-4;
  /// No step is shorter.
  static constexpr double kShortest = 1e-14;
  /// A hop over a kink is as long as this part of the tolerance.
  static constexpr double kKinkResolution = 0.1;

  const int S;  // shafts
  System& system_;
  Drivetrain& drivetrain_;  // the system's
  Path path_;
  Tolerance tolerance_;
  std::unique_ptr<PathStepper> stepper_;
  LeastReactionSolver consistency_;
  bool straight_ = true;
  double kinks_[kMostKinks] = {};  // at the path's present place
  double row_reference_[kMaxRows] = {};
};

}  // namespace variator_sim
