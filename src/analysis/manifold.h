/// The linear algebra of constraints: equations between quantities of very different sizes, and
/// coordinates on the manifold that a motion keeps to. Not for the loop.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace variator_sim {

/// Solves M x = right with rows and columns of M brought to like sizes. Throws SceneError where M
/// is singular or not finite.
Eigen::MatrixXd solveScaled(const Eigen::MatrixXd& M, const Eigen::MatrixXd& right);

/// Some of the states, which the others follow from: x = N x_kept wherever G x = 0.
struct ManifoldCoordinates {
  std::vector<int> kept;
  Eigen::MatrixXd N;
};

/// Leaves out velocities (columns `shafts` to 2 `shafts` - 1) for the first `velocity_rows` rows of
/// G and accelerations, the columns behind them, for the others, which may be dependent: those that
/// the rows turn most in the metric of `inertia` (one entry a shaft). Throws SceneError where the
/// rows have lost rank.
ManifoldCoordinates findCoordinates(const Eigen::MatrixXd& G, int velocity_rows,
                                    const Eigen::VectorXd& inertia);

}  // namespace variator_sim
