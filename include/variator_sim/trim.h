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
  /// The fixed value; for a free quantity the start of the search (NaN: the scene's start).
  double value = std::numeric_limits<double>::quiet_NaN();
};

/// Quantities without a name here: velocities, and angles that laws read, are free; inputs and the
/// time are as at the scene's start.
struct TrimOptions {
  std::vector<TrimChoice> fix;
  std::vector<TrimChoice> free;
  /// False: constant speeds, epsilon = 0. True: accelerations in constant ratios,
  /// epsilon' = mu epsilon, epsilon not 0.
  bool accelerating = false;
};

struct TrimState {
  OperatingPoint point;
  /// The largest residual of the equations, N m, N m/s, or the constraint's own unit.
  double residual = 0.0;
  /// Speeds, accelerations and inputs that may change together from here on without leaving the
  /// steady states. Not empty: this is one of infinitely many.
  std::vector<std::string> undetermined;
};

struct TrimResult {
  /// The states found, the nearest to the scene's start first; one of infinitely many.
  std::vector<TrimState> states;
  /// The result, or the reason why there is none, as a sentence.
  std::string message;
};

/// Solves x' = 0 but for the angles (or epsilon' = mu epsilon), and R = C^T lambda under both
/// principles (doc/linear_models.md), by Newton's iteration with exact derivatives from several
/// starts, the same ones at every call. Throws SceneError for an unknown name.
TrimResult trim(const Scene& scene, const TrimOptions& options);

}  // namespace variator_sim
