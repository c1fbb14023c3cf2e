/// Trim: the steady states of a scene under given speeds, torques and inputs.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "variator_sim/operating_point.h"

namespace variator_sim {

/// A quantity by its name: `w_SHAFT`, `phi_SHAFT`, `e_SHAFT` (or as columns are named,
/// `SHAFT/velocity`), an input, `t`; where it is fixed also `SHAFT/applied_torque`,
/// `SHAFT/reaction_torque` and the scene's outputs.
struct TrimChoice {
  std::string name;
  /// What it is to be; of what is free, where the search starts (NaN: as at the scene's start).
  double value = std::numeric_limits<double>::quiet_NaN();
};

/// What is not named: velocities, and angles that laws read, are free; inputs and the time are what
/// they are at the scene's start.
struct TrimOptions {
  std::vector<TrimChoice> fix;
  std::vector<TrimChoice> free;
  /// False: constant speeds, epsilon = 0. True: accelerations in constant ratios,
  /// epsilon' = mu epsilon, epsilon not 0.
  bool accelerating = false;
};

struct TrimState {
  OperatingPoint point;
  /// What is left of the equations, N m, N m/s, or the constraint's own unit: the largest.
  double residual = 0.0;
  /// Speeds, accelerations and inputs that may change together from here on without leaving the
  /// steady states. Not empty: this is one of infinitely many.
  std::vector<std::string> undetermined;
};

struct TrimResult {
  /// Those found, the nearest to the scene's start first. Of infinitely many, one.
  std::vector<TrimState> states;
  /// What was found, or why nothing was, as a sentence.
  std::string message;
};

/// Looks for x' = 0 but for the angles (or epsilon' = mu epsilon), and R = C^T lambda under both
/// principles (doc/linear_models.md), by Newton's iteration with exact derivatives from several
/// starts, the same ones at every call. Throws SceneError for a name that means nothing.
TrimResult trim(const Scene& scene, const TrimOptions& options);

}  // namespace variator_sim
