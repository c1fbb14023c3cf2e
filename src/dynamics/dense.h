/// Small dense systems of linear equations, solved in one place: Eigen's decompositions take long
/// to compile, and every size of a scene needs the same ones. Nothing here allocates.
#pragma once

#include <Eigen/LU>

#include "variator_sim/types.h"

namespace variator_sim {

/// Rows of the largest system: accelerations and multipliers of a scene, at most kMaxShafts each.
constexpr int kMaxDense = 2 * kMaxShafts;
using DenseMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDense, kMaxDense>;
using DenseVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDense, 1>;

/// A matrix of s x s entries.
using SquareMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxShafts, kMaxShafts>;

/// Solves A x = b by LU with partial pivoting, every row scaled by its largest entry, which makes
/// the pivoting independent of the equations' units (A and b are scaled in place). Returns false if
/// A is singular or a number is not finite. [loop]
bool solveScaled(DenseMatrix& A, DenseVector& b, DenseVector* x);

/// Replaces b by A^-1 b, A symmetric, by L D L^T. Returns false if an entry of D is not above
/// `least`. [loop]
bool solveSymmetric(const DenseMatrix& A, double least, DenseVector* b);

/// Returns the symmetric inverse of a symmetric positive definite matrix. [loop]
SquareMatrix invertSymmetric(const SquareMatrix& A);

}  // namespace variator_sim
