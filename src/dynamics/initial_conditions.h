/// Consistent initial values, and the accelerations of least reaction: the classical Gauss
/// principle at one instant.
#pragma once

#include "dynamics/drivetrain.h"
#include "dynamics/least_reaction.h"
#include "dynamics/least_reaction_search.h"
#include "dynamics/projection.h"

namespace variator_sim {

enum class InitialResult {
  kConsistent,
  kInconsistent,  ///< the given accelerations do not satisfy psi = 0 and may not be moved
  kSingular,      ///< C has lost rank there
  kNonFinite,     ///< a torque or a constraint is not finite there
  kNotFound,      ///< Newton's iteration found no accelerations with psi = 0
  kNotUnique,     ///< several accelerations have the same least reaction
  kDoubtful       ///< accelerations with a lesser reaction may exist
};

/// Solves for the accelerations at one (t, phi, omega, u). It allocates nothing, although it does
/// not run in the loop: a command at the first instant calls it again.
class InitialConditionSolver {
 public:
  static constexpr double kConsistent = LeastReactionSolver::kConsistent;

  explicit InitialConditionSolver(Drivetrain& drivetrain)
      : S(drivetrain.shafts()),
        drivetrain_(drivetrain),
        solver_(drivetrain),
        search_(drivetrain, solver_) {}

  LeastReactionSolver& solver() { return solver_; }
  /// The search of the last findLeastReaction, with the reactions.
  const LeastReactionSearch& search() const { return search_; }

  /// Accepts given velocities: consistent ones are refined to f = 0 (constraints of order 1),
  /// inconsistent ones moved there only if `may_move`. `nearest` (S values) receives the nearest
  /// consistent velocities. `state.velocity` must point to `omega` (S values).
  InitialResult acceptVelocities(const StateView& state, bool may_move, double* omega,
                                 double* nearest);

  /// Finds the accelerations of least reaction: the classical Gauss principle, minimise 1/2 R^T
  /// J^-1 R under psi = 0. If psi is linear in epsilon, the only stationary point is the minimum;
  /// otherwise the search starts from a first stationary point. `state.acceleration` must point to
  /// `epsilon` (S values, written).
  InitialResult findLeastReaction(const StateView& state, double* epsilon);

  /// Accepts given accelerations: consistent ones are refined to psi = 0, inconsistent ones moved
  /// there only if `may_move`. `nearest` (S values) receives the nearest consistent accelerations.
  /// `state.acceleration` must point to `epsilon` (S values).
  InitialResult acceptAccelerations(const StateView& state, bool may_move, double* epsilon,
                                    double* nearest);

 private:
  /// Replaces `values` by `nearest` if they agree to the printed digits, or if `may_move`.
  InitialResult acceptNearest(bool may_move, double* values, const double* nearest) const;

  InitialResult explain(const StateView& state, const double* epsilon);

  /// Up to 100 half steps towards the least reaction of the linearised constraints, from `epsilon`.
  void approach(const StateView& given, const double* free, double* epsilon);

  const int S;  // shafts
  Drivetrain& drivetrain_;
  LeastReactionSolver solver_;
  LeastReactionSearch search_;
};

}  // namespace variator_sim
