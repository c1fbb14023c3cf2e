/// Consistent initial values, and the accelerations of least reaction: the classical Gauss
/// principle at one instant.
#pragma once

#include <Eigen/LU>
#include <cmath>

#include "drivetrain.h"
#include "projection.h"

namespace variator_sim {

enum class InitialResult {
  kConsistent,
  kInconsistent,  ///< the given accelerations do not satisfy psi = 0 and may not be moved
  kSingular,      ///< C has lost rank there
  kNonFinite,     ///< a torque or a constraint is not finite there
  kNotFound,      ///< Newton's iteration found no accelerations with psi = 0
  kNotUnique      ///< several accelerations have the same least reaction
};

/// Solves for the accelerations at one (t, phi, omega, u). Not for the running loop, but free of
/// allocation all the same: a command at the first instant calls it anew.
template <class Shape>
class InitialConditionSolver {
 public:
  static constexpr int S = Shape::kShafts;
  static constexpr int kMaxRows = Drivetrain<Shape>::kMaxRows;
  /// Accelerations count as consistent when the nearest point of psi = 0 is not further away than
  /// this, relative to max(1, |epsilon|): what is left of a value printed with ten digits.
  static constexpr double kConsistent = 1e-9;

  explicit InitialConditionSolver(Drivetrain<Shape>& drivetrain) : drivetrain_(drivetrain) {}

  /// Takes given velocities: consistent ones are polished onto f = 0 (constraints of order 1),
  /// inconsistent ones moved there only when `may_move`. `nearest` (S values) gets the nearest
  /// consistent velocities. `state.velocity` must point to `omega` (S values).
  InitialResult acceptVelocities(const StateView& state, bool may_move, double* omega,
                                 double* nearest) {
    std::copy(omega, omega + S, nearest);
    StateView moving = state;
    moving.velocity = nearest;
    double moved[S];
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
  /// psi = 0. Stationarity, with R = J epsilon + n - Q:
  ///     J epsilon + n - Q - C^T lambda = 0,   psi = 0,
  /// solved by damped Newton from the free accelerations J^-1 (Q - n).
  /// `state.acceleration` must point to `epsilon` (S values, written).
  InitialResult findLeastReaction(const StateView& state, double* epsilon) {
    double torque[S];
    double free[S];
    drivetrain_.calcFreeTorque(state, torque);
    drivetrain_.inertia().solve(torque, free);
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(free[i])) return InitialResult::kNonFinite;
      epsilon[i] = free[i];
    }
    if (!drivetrain_.hasAccelerationRows()) return InitialResult::kConsistent;
    double lambda[kMaxRows] = {};
    if (solveLeastReaction(state, torque, epsilon, lambda)) return InitialResult::kConsistent;
    // Far from psi = 0 Newton's iteration may lead away; damped steps to the solution of the
    // linearised constraints come near first.
    for (int i = 0; i < S; ++i) epsilon[i] = free[i];
    approach(state, free, epsilon);
    std::fill(lambda, lambda + kMaxRows, 0.0);
    if (solveLeastReaction(state, torque, epsilon, lambda)) return InitialResult::kConsistent;
    // C may vanish at the free accelerations (psi = eps1^2 + eps2^2 - a^2 without torque): start
    // aside of them, in the direction of each shaft, and keep the least reaction found.
    double best = std::numeric_limits<double>::infinity();
    double found[S] = {};
    bool unique = true;
    double length = 1.0;
    for (int i = 0; i < S; ++i) length = std::max(length, std::abs(free[i]));
    for (int i = 0; i < S; ++i) {
      for (double sign : {1.0, -1.0}) {
        for (int j = 0; j < S; ++j) epsilon[j] = free[j];
        epsilon[i] += sign * length;
        std::fill(lambda, lambda + kMaxRows, 0.0);
        if (!solveLeastReaction(state, torque, epsilon, lambda)) continue;
        double R[S];
        double reaction_acceleration[S];
        drivetrain_.inertia().multiply(epsilon, R);
        for (int j = 0; j < S; ++j) R[j] -= torque[j];
        drivetrain_.inertia().solve(R, reaction_acceleration);
        double reaction = 0.0;
        for (int j = 0; j < S; ++j) reaction += R[j] * reaction_acceleration[j];
        if (reaction < best * (1.0 - 1e-9)) {
          best = reaction;
          unique = true;
          for (int j = 0; j < S; ++j) found[j] = epsilon[j];
        } else if (reaction <= best * (1.0 + 1e-9)) {
          for (int j = 0; j < S; ++j) {
            unique = unique && std::abs(epsilon[j] - found[j]) <= 1e-6 * length;
          }
        }
      }
    }
    for (int i = 0; i < S; ++i) epsilon[i] = std::isfinite(best) ? found[i] : free[i];
    if (!unique) return InitialResult::kNotUnique;
    if (std::isfinite(best)) return InitialResult::kConsistent;
    return explain(state, epsilon);
  }

  /// Newton's iteration for the accelerations of least reaction and their multipliers from those
  /// given in `epsilon` (S values) and `lambda` (one per row of accelerationRows()); `torque` is
  /// Q - n. False when it does not converge.
  bool solveLeastReaction(const StateView& given, const double* torque, double* epsilon,
                          double* lambda) {
    const int k = static_cast<int>(drivetrain_.accelerationRows().size());
    StateView state = given;
    state.acceleration = epsilon;
    Vector step;
    if (!calcStep(state, torque, epsilon, lambda, &step)) return false;
    // Near equilibrium epsilon is the small difference of large terms; this is what they round to.
    double free[S];
    drivetrain_.inertia().solve(torque, free);
    double rounding = 1e-290;
    for (int i = 0; i < S; ++i) {
      rounding =
          std::max(rounding, 64.0 * std::numeric_limits<double>::epsilon() * std::abs(free[i]));
    }
    for (int iteration = 0; iteration < 200; ++iteration) {
      const double length = calcLength(step);
      // Natural monotonicity (Deuflhard): the next step, which does not depend on how the equations
      // are scaled, must be shorter; halve otherwise.
      double fraction = 1.0;
      double epsilon_old[S];
      double lambda_old[kMaxRows];
      for (int i = 0; i < S; ++i) epsilon_old[i] = epsilon[i];
      for (int m = 0; m < k; ++m) lambda_old[m] = lambda[m];
      Vector next;
      bool shorter = false;
      for (int halving = 0; halving < 40 && !shorter; ++halving, fraction *= 0.5) {
        for (int i = 0; i < S; ++i) epsilon[i] = epsilon_old[i] + fraction * step(i);
        for (int m = 0; m < k; ++m) lambda[m] = lambda_old[m] + fraction * step(S + m);
        if (!calcStep(state, torque, epsilon, lambda, &next)) continue;
        shorter = calcLength(next) <= (1.0 - 0.25 * fraction) * length ||
                  isSmall(next, epsilon, rounding);
      }
      if (!shorter) return false;
      if (isSmall(next, epsilon, rounding)) {
        // The last correction is below what can be told apart; make it, and polish psi alone.
        for (int i = 0; i < S; ++i) epsilon[i] += next(i);
        for (int m = 0; m < k; ++m) lambda[m] += next(S + m);
        double moved[S];
        std::uint64_t iterations = 0;
        return projectAccelerations(drivetrain_, state, epsilon, moved, &iterations) ==
               ProjectionResult::kConverged;
      }
      step = next;
    }
    return false;
  }

  /// Takes given accelerations: consistent ones are polished onto psi = 0, inconsistent ones moved
  /// there only when `may_move`. `nearest` (S values) gets the nearest consistent accelerations.
  /// `state.acceleration` must point to `epsilon` (S values).
  InitialResult acceptAccelerations(const StateView& state, bool may_move, double* epsilon,
                                    double* nearest) {
    std::copy(epsilon, epsilon + S, nearest);
    StateView moving = state;
    moving.acceleration = nearest;
    double moved[S];
    std::uint64_t iterations = 0;
    switch (projectAccelerations(drivetrain_, moving, nearest, moved, &iterations)) {
      case ProjectionResult::kSingular:
      case ProjectionResult::kDiverged:
        return explain(state, epsilon);
      case ProjectionResult::kConverged:
        break;
    }
    return acceptNearest(may_move, epsilon, nearest);
  }

 private:
  /// `values` become `nearest` when these are as near as consistent values print, or `may_move`.
  static InitialResult acceptNearest(bool may_move, double* values, const double* nearest) {
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

  static constexpr int kMaxSize = S + kMaxRows;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSize, kMaxSize>;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxSize, 1>;

  InitialResult explain(const StateView& state, const double* epsilon) {
    StateView there = state;
    there.acceleration = epsilon;
    int torque;
    int constraint;
    if (drivetrain_.findNonFinite(there, &torque, &constraint)) return InitialResult::kNonFinite;
    // On psi = 0 the motion could start but for C; elsewhere there is nowhere to start.
    double delta[S];
    if (drivetrain_.calcAccelerationProjection(there, delta)) return InitialResult::kNotFound;
    for (int m : drivetrain_.accelerationRows()) {
      double C[S];
      if (drivetrain_.constraint(m).calcResidualAndJacobian(there, C) != 0.0) {
        return InitialResult::kNotFound;
      }
    }
    return InitialResult::kSingular;
  }

  /// The step (delta epsilon, lambda - lambda_old) of Newton's iteration at (epsilon, lambda).
  /// False when the matrix is singular or not finite.
  bool calcStep(const StateView& state, const double* torque, const double* epsilon,
                const double* lambda, Vector* step) {
    drivetrain_.countNewtonIteration();
    const std::vector<int>& rows = drivetrain_.accelerationRows();
    const int k = static_cast<int>(rows.size());
    const int n = S + k;
    //  [ J - sum lambda_m H_m   -C^T ] [d epsilon]     [ J epsilon + n - Q - C^T lambda ]
    //  [ C                       0   ] [d lambda ] = - [ psi                            ]
    Matrix K = Matrix::Zero(n, n);
    Vector F = Vector::Zero(n);
    double unit[S];
    double column[S];
    for (int j = 0; j < S; ++j) {
      for (int i = 0; i < S; ++i) unit[i] = i == j ? 1.0 : 0.0;
      drivetrain_.inertia().multiply(unit, column);
      for (int i = 0; i < S; ++i) {
        K(i, j) = column[i];
        F(i) += column[i] * epsilon[j];
      }
    }
    for (int i = 0; i < S; ++i) F(i) -= torque[i];
    for (int m = 0; m < k; ++m) {
      double C[S];
      double H[S * S];
      const Constraint& constraint = drivetrain_.constraint(rows[m]);
      F(S + m) = constraint.calcResidualAndJacobian(state, C);
      constraint.calcHessian(state, H);
      for (int i = 0; i < S; ++i) {
        K(S + m, i) = C[i];
        K(i, S + m) = -C[i];
        F(i) -= C[i] * lambda[m];
        for (int j = 0; j < S; ++j) K(i, j) -= lambda[m] * H[i * S + j];
      }
    }
    if (!K.allFinite() || !F.allFinite()) return false;
    // Scaling every row by its largest entry makes the pivoting blind to the units of psi.
    for (int i = 0; i < n; ++i) {
      const double largest = K.row(i).cwiseAbs().maxCoeff();
      if (largest == 0.0) return false;
      K.row(i) /= largest;
      F(i) /= largest;
    }
    *step = -K.partialPivLu().solve(F);
    return step->allFinite();
  }

  static double calcLength(const Vector& step) { return step.head(S).cwiseAbs().maxCoeff(); }

  /// Up to 100 half steps towards the least reaction of the linearised constraints, from `epsilon`.
  void approach(const StateView& given, const double* free, double* epsilon) {
    StateView state = given;
    state.acceleration = epsilon;
    for (int iteration = 0; iteration < 100; ++iteration) {
      double delta[S];
      if (!drivetrain_.calcLinearizedReaction(state, free, delta)) return;
      for (int i = 0; i < S; ++i) {
        if (!std::isfinite(delta[i])) return;
        epsilon[i] += 0.5 * (free[i] + delta[i] - epsilon[i]);
      }
    }
  }

  static bool isSmall(const Vector& step, const double* epsilon, double rounding) {
    double scale = 0.0;
    for (int i = 0; i < S; ++i) scale = std::max(scale, std::abs(epsilon[i]));
    // Quadratic convergence: the step after one of 1e-9 is lost in rounding.
    return calcLength(step) <= std::max(1e-9 * scale, rounding);
  }

  Drivetrain<Shape>& drivetrain_;
};

}  // namespace variator_sim
