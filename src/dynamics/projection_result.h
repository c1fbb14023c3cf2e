/// How a projection onto the constraints ended.
#pragma once

namespace variator_sim {

enum class ProjectionResult {
  kConverged,
  kSingular,  ///< C lost rank
  kDiverged   ///< Newton's iteration did not converge, or a residual is not finite
};

}  // namespace variator_sim
