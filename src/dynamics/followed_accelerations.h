/// The accelerations under the classical Gauss principle up to order 2: the stationary point of the
/// reaction at (t, phi, omega), followed along a motion.
#pragma once

#include "dynamics/initial_conditions.h"
#include "variator_sim/scene.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// If psi is linear in the accelerations, they are the only stationary point. Otherwise there may
/// be several, and Newton's iteration starts from those at the step start for every caller and in
/// every order: samples may not change the motion. All but `start` are [loop].
class FollowedAccelerations {
 public:
  FollowedAccelerations(Drivetrain& drivetrain, InitialConditionSolver& initial_solver)
      : S(drivetrain.shafts()),
        drivetrain_(drivetrain),
        initial_solver_(initial_solver),
        is_linear_(drivetrain.nonlinearAccelerations().none()) {}

  /// The accelerations computed last, S values.
  const double* last() const { return epsilon_; }
  /// Computes them at `state`, whose accelerations point there; NaN if there are none.
  void calc(const StateView& state);
  /// The multipliers of the reaction at `state`, one per constraint; unchanged where C has lost
  /// rank.
  void calcMultipliers(const StateView& state, double* lambda);

  /// True when given accelerations agree with those computed last.
  bool areNear(const double* given) const;
  bool isLinear() const { return is_linear_; }
  /// Computes those of least reaction at the start of a motion; given ones select one of several
  /// stationary points. See System::start.
  InitialResult start(const StateView& state, const InitialConditions& initial, double* nearest);
  /// See System::accept.
  InitialResult accept(const StateView& state, bool may_move, bool are_given, double* epsilon,
                       double* nearest);

  /// Iterations start from `epsilon` at the step start.
  void noteStepStart(double t, const State& x, const double* epsilon);

 private:
  /// The same under `torque`, Q - n.
  void calc(const StateView& state, const double* torque);

  /// Starts the iterations from `epsilon` and its multipliers.
  void guess(const StateView& state, const double* epsilon);

  const int S;  // shafts
  Drivetrain& drivetrain_;
  InitialConditionSolver& initial_solver_;
  const bool is_linear_;
  double epsilon_[kMaxShafts] = {};
  double guess_[kMaxShafts] = {};
  double lambda_guess_[kMaxRows] = {};
  double multipliers_[kMaxShafts] = {};  // at epsilon_, where psi is not linear
};

}  // namespace variator_sim
