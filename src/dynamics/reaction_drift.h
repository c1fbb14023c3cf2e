/// Drift correction of the reaction under the generalized Gauss principle.
///
/// R' = C^T Lambda: the component of the reaction R in the null space that no C of the motion has
/// reached is a constant. The integrator's errors move it all the same, so that the accelerations
/// are corrected at the step ends:
///     J d_epsilon = C^T lambda - (R - R_0),   C d_epsilon = 0.
#pragma once

#include "dynamics/drivetrain.h"
#include "dynamics/step_node.h"
#include "dynamics/tolerance.h"
#include "variator_sim/motion_state.h"

namespace variator_sim {

/// The constant of one motion. All but the construction is [loop].
class ReactionDrift {
 public:
  /// `exists`: false where R does not change least, so that there is no such constant.
  ReactionDrift(Drivetrain& drivetrain, Tolerance tolerance, bool exists)
      : S(drivetrain.shafts()), drivetrain_(drivetrain), tolerance_(tolerance), exists_(exists) {}

  /// Keeps the reaction at `node`, where a motion begins.
  void note(const StepNode& node);
  /// Removes the shafts that C, the rows at the end of a step, has reached.
  void noteRows(const double (*C)[kMaxShafts]);
  /// Corrects the accelerations of a node, whose torque is known, along psi = 0. Where a torque
  /// answers steeply to the state, the velocities are what is wrong: these are corrected first, and
  /// the accelerations by at most `most` tolerances.
  void correct(StepNode& node, double most);

  /// The constant of a motion that is saved and continues elsewhere.
  KeptReaction kept() const { return kept_; }
  void keep(const KeptReaction& kept) { kept_ = kept; }

 private:
  StateView view(double time, const State& x) {
    return drivetrain_.view(time, x.data(), x.data() + S, x.data() + 2 * S);
  }
  /// Returns true if errors of one tolerance in angles and velocities, or rounding of the time,
  /// change the accelerations through Q by more than their tolerance.
  bool answersSteeply(const StepNode& node);

  /// Computes the accelerations that would bring the reaction back. False where C has lost rank.
  bool calcLost(const StepNode& node, double* change);
  /// Returns the largest change in tolerances.
  double measure(const StepNode& node, const double* change) const;
  /// Moves the velocities of a node, to which the torque answers steeply, so that the reaction
  /// comes nearer to its constant part; by at most `most` tolerances. False where that leaves
  /// `largest`, the part that is lost, as large.
  bool moveVelocities(StepNode& node, const double* change, double largest, double most);

  const int S;  // shafts
  Drivetrain& drivetrain_;
  const Tolerance tolerance_;
  const bool exists_;
  /// N m; divided by sqrt(J_i) where the inertia depends on the angle: R' = C^T Lambda + Gamma R
  /// omega [6] becomes R_i' = 1/2 J_i'/J_i omega_i R_i there, so R_i / sqrt(J_i) is invariant.
  /// (Coupled inertias that depend on angles have no such simple invariant.)
  KeptReaction kept_;
};

}  // namespace variator_sim
