/// Checks of symmetric matrices of up to kMaxShafts rows: once per scene, so in plain loops.
/// Eigen's decompositions of matrices of any size take the compiler ten seconds.
#pragma once

#include <Eigen/Core>

namespace variator_sim {

bool isPositiveDefinite(const Eigen::MatrixXd& A);

double calcSmallestEigenvalue(const Eigen::MatrixXd& A);

/// Returns 1 / (A^-1)_ii of a positive definite A: for an inertia matrix the torque, N m, that
/// accelerates shaft i by 1 rad/s^2 while all others are free.
double calcFreeDiagonal(const Eigen::MatrixXd& A, int i);

}  // namespace variator_sim
