/// Consistent initial values, and the accelerations of least reaction: the classical Gauss
/// principle at one instant.
#pragma once

#include <cmath>

#include "drivetrain.h"
#include "least_reaction.h"
#include "least_reaction_search.h"
#include "projection.h"

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
                                 double* nearest) {
    std::copy(omega, omega + S, nearest);
    StateView moving = state;
    moving.velocity = nearest;
    double moved[kMaxShafts];
    std::uint64_t iterations = 0;
    switch (projectVelocities(drivetrain_, moving, nearest, moved, &iterations)) {
      case ProjectionResult::kSingular:
        return InitialResult::kSingular;
      case ProjectionResult::kDiverged:
        return InitialResult::kNotFound;
      case ProjectionResult::kConverged:
        break;
    }
    return acceptNearest(may_move, omega, nearest);
  }

  /// Accelerations of least reaction: the classical Gauss principle, minimise 1/2 R^T J^-1 R under
  /// psi = 0. Where psi is linear in epsilon its one stationary point is the least; otherwise a
  /// first one is, for the search to find a better one.
  /// `state.acceleration` must point to `epsilon` (S values, written).
  InitialResult findLeastReaction(const StateView& state, double* epsilon) {
    double torque[kMaxShafts];
    double free[kMaxShafts];
    search_.forget();
    drivetrain_.calcFreeTorque(state, torque);
    drivetrain_.inertia().solve(torque, free);
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(free[i])) return InitialResult::kNonFinite;
      epsilon[i] = free[i];
    }
    if (!drivetrain_.hasAccelerationRows()) return InitialResult::kConsistent;
    double multipliers[kMaxShafts] = {};
    bool is_found = solver_.solve(state, torque, 0, epsilon, multipliers);
    if (!is_found) {
      // Far from psi = 0 Newton's iteration may lead away; damped steps to the solution of the
      // linearised constraints come near first.
      std::copy_n(free, S, epsilon);
      approach(state, free, epsilon);
      std::fill_n(multipliers, S, 0.0);
      is_found = solver_.solve(state, torque, 0, epsilon, multipliers);
    }
    if (drivetrain_.nonlinearAccelerations() == 0) {
      if (is_found) return InitialResult::kConsistent;
      std::copy_n(free, S, epsilon);
      return explain(state, epsilon);
    }
    using Verdict = LeastReactionSearch::Verdict;
    if (is_found) search_.add(epsilon, free);
    const Verdict verdict = search_.find(state, torque, free);
    const bool has_any = search_.candidateCount() > 0;
    std::copy_n(has_any ? search_.candidate(0).epsilon : free, S, epsilon);
    switch (verdict) {
      case Verdict::kFound:
        return InitialResult::kConsistent;
      case Verdict::kTie:
        return InitialResult::kNotUnique;
      case Verdict::kDoubtful:
        return InitialResult::kDoubtful;
      case Verdict::kNone:
        break;
    }
    return explain(state, epsilon);
  }

  /// Takes given accelerations: consistent ones are polished onto psi = 0, inconsistent ones moved
  /// there only when `may_move`. `nearest` (S values) gets the nearest consistent accelerations.
  /// `state.acceleration` must point to `epsilon` (S values).
  InitialResult acceptAccelerations(const StateView& state, bool may_move, double* epsilon,
                                    double* nearest) {
    std::copy(epsilon, epsilon + S, nearest);
    StateView moving = state;
    moving.acceleration = nearest;
    if (drivetrain_.hasAccelerationRows() && !solver_.retract(moving, nearest)) {
      return explain(state, epsilon);
    }
    return acceptNearest(may_move, epsilon, nearest);
  }

 private:
  /// `values` become `nearest` when these are as near as consistent values print, or `may_move`.
  InitialResult acceptNearest(bool may_move, double* values, const double* nearest) const {
    double scale = 1.0;
    double distance = 0.0;
    for (int i = 0; i < S; ++i) {
      scale = std::max(scale, std::abs(values[i]));
      distance = std::max(distance, std::abs(nearest[i] - values[i]));
    }
    if (!(distance <= kConsistent * scale) && !may_move) return InitialResult::kInconsistent;
    std::copy(nearest, nearest + S, values);
    return InitialResult::kConsistent;
  }

  InitialResult explain(const StateView& state, const double* epsilon) {
    StateView there = state;
    there.acceleration = epsilon;
    int torque;
    int constraint;
    if (drivetrain_.findNonFinite(there, &torque, &constraint)) return InitialResult::kNonFinite;
    // On psi = 0 the motion could start but for C; elsewhere there is nowhere to start.
    double delta[kMaxShafts];
    if (drivetrain_.calcAccelerationProjection(there, delta)) return InitialResult::kNotFound;
    for (int m : drivetrain_.accelerationRows()) {
      double C[kMaxShafts];
      if (drivetrain_.constraint(m).calcResidualAndJacobian(there, C) != 0.0) {
        return InitialResult::kNotFound;
      }
    }
    return InitialResult::kSingular;
  }

  /// Up to 100 half steps towards the least reaction of the linearised constraints, from `epsilon`.
  void approach(const StateView& given, const double* free, double* epsilon) {
    StateView state = given;
    state.acceleration = epsilon;
    for (int iteration = 0; iteration < 100; ++iteration) {
      double delta[kMaxShafts];
      if (!drivetrain_.calcLinearizedReaction(state, free, delta)) return;
      for (int i = 0; i < S; ++i) {
        if (!std::isfinite(delta[i])) return;
        epsilon[i] += 0.5 * (free[i] + delta[i] - epsilon[i]);
      }
    }
  }

  const int S;  // shafts
  Drivetrain& drivetrain_;
  LeastReactionSolver solver_;
  LeastReactionSearch search_;
};

}  // namespace variator_sim
