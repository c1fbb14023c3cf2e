/// The accelerations that a motion begins with, where psi is not linear in them and several may be
/// consistent.
#pragma once

#include "dynamics/acceleration_constraints.h"
#include "dynamics/least_reaction.h"
#include "dynamics/least_reaction_search.h"

namespace variator_sim {

/// Allocates nothing, although it does not run in the loop: a command at the first instant calls it
/// again.
class FirstAccelerations {
 public:
  using Verdict = LeastReactionSearch::Verdict;

  /// `scene` has to outlive it.
  explicit FirstAccelerations(const Scene& scene)
      : S(scene.shaftCount()),
        constraints_(scene),
        solver_(constraints_),
        search_(constraints_, solver_) {}

  /// The search of the last findLeastReaction, with the reactions.
  const LeastReactionSearch& search() const { return search_; }

  /// Finds the accelerations of least reaction: the classical Gauss principle, minimise 1/2 R^T
  /// J^-1 R under psi = 0, at a state whose own are not read. `epsilon` gets the best candidate, or
  /// the free accelerations where there is none.
  Verdict findLeastReaction(const StateView& state, double* epsilon);
  /// Moves given accelerations onto psi = 0 near by. False where that fails.
  bool retract(const StateView& state, double* epsilon);
  /// Finds the point of stationary reaction at `state` by iterating from `epsilon` and the
  /// multipliers (kMaxShafts places) of a point near by. False where that fails.
  bool follow(const StateView& state, double* epsilon, double* multipliers) {
    constraints_.enter(state);
    return solver_.solve(state, 0, epsilon, multipliers);
  }
  /// Writes the multipliers of the reaction at `state`, one per constraint: others may lead the
  /// iteration to another branch. False if C has lost rank.
  bool calcMultipliers(const StateView& state, double* lambda) {
    constraints_.enter(state);
    return constraints_.calcMultipliers(state, lambda);
  }

 private:
  /// Up to 100 half steps towards the least reaction of the linearised constraints, from `epsilon`.
  void approach(const StateView& given, double* epsilon);

  const int S;  // shafts
  AccelerationConstraints constraints_;
  LeastReactionSolver solver_;
  LeastReactionSearch search_;
};

}  // namespace variator_sim
