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
  kDoubtful       ///< there may be accelerations with a lesser reaction than those found
};

/// Solves for the accelerations at one (t, phi, omega, u). Not for the running loop, but free of
/// allocation all the same: a command at the first instant calls it anew.
class InitialConditionSolver {
 public:
  static constexpr double kConsistent = LeastReactionSolver::kConsistent;

  explicit InitialConditionSolver(Drivetrain& drivetrain)
      : S(drivetrain.shafts()),
        drivetrain_(drivetrain),
        solver_(drivetrain),
        search_(drivetrain, solver_) {}

  LeastReactionSolver& solver() { return solver_; }
  /// What findLeastReaction came to, with the reactions.
  const LeastReactionSearch& search() const { return search_; }

  /// Takes given velocities: consistent ones are polished onto f = 0 (constraints of order 1),
  /// inconsistent ones moved there only when `may_move`. `nearest` (S values) gets the nearest
  /// consistent velocities. `state.velocity` must point to `omega` (S values).
  InitialResult acceptVelocities(const StateView& state, bool may_move, double* omega,
                                 double* nearest);

  /// Accelerations of least reaction: the classical Gauss principle, minimise 1/2 R^T J^-1 R under
  /// psi = 0. Where psi is linear in epsilon its one stationary point is the least; otherwise a
  /// first one is, for the search to find a better one.
  /// `state.acceleration` must point to `epsilon` (S values, written).
  InitialResult findLeastReaction(const StateView& state, double* epsilon);

  /// Takes given accelerations: consistent ones are polished onto psi = 0, inconsistent ones moved
  /// there only when `may_move`. `nearest` (S values) gets the nearest consistent accelerations.
  /// `state.acceleration` must point to `epsilon` (S values).
  InitialResult acceptAccelerations(const StateView& state, bool may_move, double* epsilon,
                                    double* nearest);

 private:
  /// `values` become `nearest` when these are as near as consistent values print, or `may_move`.
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
