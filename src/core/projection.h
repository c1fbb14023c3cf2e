/// Projection of the accelerations onto psi = 0 in the metric of the inertia.
///
/// psi' = 0 alone lets psi drift with the integrator's error. Newton's iteration
///     delta epsilon = -J^-1 C^T A^-1 psi
/// moves epsilon along range(J^-1 C^T) only: the part of the reaction that the constraint cannot
/// change stays as it is, and for constant C the invariant R(t) - R(0) in range(C^T) survives.
#pragma once

#include <algorithm>
#include <cmath>

#include "drivetrain.h"

namespace variator_sim {

enum class ProjectionResult {
  kConverged,
  kSingular,  ///< C lost rank
  kDiverged   ///< Newton's iteration did not converge, or psi is not finite
};

/// Projects the accelerations `epsilon` (S values, in place); the rest of `state` is fixed and
/// `state.acceleration` must point to `epsilon`. `moved` gets |delta_i| summed over the iterations
/// (S values), `iterations` is increased by those done.
template <int S>
ProjectionResult project(Drivetrain<S>& drivetrain, const StateView& state, double* epsilon,
                         double* moved, std::uint64_t* iterations) {
  for (int i = 0; i < S; ++i) moved[i] = 0.0;
  if (drivetrain.constraintCount() == 0) return ProjectionResult::kConverged;
  constexpr int kMaxIterations = 25;
  // Newton converges quadratically: after a correction of 1e-8 of epsilon's size the next one would
  // be lost in rounding (1e-16), so it is not made.
  constexpr double kEnough = 1e-8;
  double previous = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    double delta[S];
    if (!drivetrain.calcProjection(state, delta)) return ProjectionResult::kSingular;
    ++*iterations;
    double size = 0.0;
    double length = 0.0;
    for (int i = 0; i < S; ++i) {
      epsilon[i] += delta[i];
      moved[i] += std::abs(delta[i]);
      size = std::max(size, std::abs(delta[i]));
      length = std::max(length, std::abs(epsilon[i]));
    }
    if (!std::isfinite(size) || !std::isfinite(length)) return ProjectionResult::kDiverged;
    if (size <= kEnough * length || size == 0.0) return ProjectionResult::kConverged;
    // Rounding can keep the corrections from shrinking below kEnough when epsilon itself is tiny.
    if (iteration > 2 && size >= 0.5 * previous) {
      return size <= 1e-6 * (length + 1.0) ? ProjectionResult::kConverged
                                           : ProjectionResult::kDiverged;
    }
    previous = size;
  }
  return ProjectionResult::kDiverged;
}

}  // namespace variator_sim
