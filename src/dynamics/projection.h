/// Projection onto the constraints in the metric of the inertia.
///
/// psi' = 0 alone lets psi drift with the steps' errors. Newton's iteration
///     delta epsilon = -J^-1 C^T A^-1 psi
/// moves epsilon along range(J^-1 C^T) only: the null-space component of the reaction is unchanged,
/// and for constant C the invariant R(t) - R(0) in range(C^T) holds. A constraint of order 1 is
/// kept twice, f = 0 by the velocities and then f' = 0 by the accelerations.
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/drivetrain.h"

namespace variator_sim {

/// How a projection onto the constraints ended.
enum class ProjectionResult {
  kConverged,
  kSingular,  ///< C lost rank
  kDiverged   ///< Newton's iteration did not converge, or a residual is not finite
};

/// Newton's iteration on `values` (`count` values, in place): `correct(delta)` writes one
/// correction at the present values and returns false if C has lost rank. `moved` gets |delta_i|
/// summed over the iterations, `iterations` is increased by those done.
template <class Correct>
ProjectionResult iterateProjection(int count, Correct correct, double* values, double* moved,
                                   std::uint64_t* iterations) {
  for (int i = 0; i < count; ++i) moved[i] = 0.0;
  constexpr int kMaxIterations = 25;
  // Newton converges quadratically: after a correction of 1e-8 of the values' size the next one
  // would be lost in rounding (1e-16), so it is not made.
  constexpr double kEnough = 1e-8;
  double previous = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    double delta[2 * kMaxShafts];
    if (!correct(delta)) return ProjectionResult::kSingular;
    ++*iterations;
    double size = 0.0;
    double length = 0.0;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int i = 0; i < count; ++i) {
      values[i] += delta[i];
      poison += 0.0 * values[i];
      moved[i] += std::abs(delta[i]);
      size = std::max(size, std::abs(delta[i]));
      length = std::max(length, std::abs(values[i]));
    }
    if (poison != 0.0) return ProjectionResult::kDiverged;
    if (size <= kEnough * length || size == 0.0) return ProjectionResult::kConverged;
    // Rounding can keep the corrections from shrinking below kEnough when the values are tiny.
    if (iteration > 2 && size >= 0.5 * previous) {
      return size <= 1e-6 * (length + 1.0) ? ProjectionResult::kConverged
                                           : ProjectionResult::kDiverged;
    }
    previous = size;
  }
  return ProjectionResult::kDiverged;
}

/// Projects the velocities onto f = 0 of the constraints of order 1. `state.velocity` must point to
/// `omega` (S values, in place); the rest is fixed.
inline ProjectionResult projectVelocities(Drivetrain& drivetrain, const StateView& state,
                                          double* omega, double* moved, std::uint64_t* iterations) {
  if (!drivetrain.hasVelocityRows()) {
    for (int i = 0; i < drivetrain.shafts(); ++i) moved[i] = 0.0;
    return ProjectionResult::kConverged;
  }
  return iterateProjection(
      drivetrain.shafts(),
      [&](double* delta) { return drivetrain.calcVelocityProjection(state, delta); }, omega, moved,
      iterations);
}

/// Projects the accelerations onto psi = 0 (order 2) and f' = 0 (order 1). `state.acceleration`
/// must point to `epsilon` (S values, in place); the rest is fixed.
inline ProjectionResult projectAccelerations(Drivetrain& drivetrain, const StateView& state,
                                             double* epsilon, double* moved,
                                             std::uint64_t* iterations) {
  if (!drivetrain.hasAccelerationRows()) {
    for (int i = 0; i < drivetrain.shafts(); ++i) moved[i] = 0.0;
    return ProjectionResult::kConverged;
  }
  return iterateProjection(
      drivetrain.shafts(),
      [&](double* delta) { return drivetrain.calcAccelerationProjection(state, delta); }, epsilon,
      moved, iterations);
}

}  // namespace variator_sim
