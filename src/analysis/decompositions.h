/// Decompositions of dense matrices, compiled in one place, as Eigen's take long. Not for the loop.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

namespace variator_sim {

/// The independent rows of a matrix, and the columns that these can be solved for.
struct IndependentRows {
  Eigen::MatrixXd transform;  ///< rank x rows: independent combinations of the rows
  std::vector<int> pivots;    ///< as many columns
};

/// Returns them; counts pivots of less than `threshold` of the largest as zero.
IndependentRows findIndependentRows(const Eigen::MatrixXd& M, double threshold);

/// Returns the x of least length that minimizes |M x - b|. Counts pivots of less than `threshold`
/// of the largest as zero; 0: those at rounding.
Eigen::VectorXd solveLeastSquares(const Eigen::MatrixXd& M, const Eigen::VectorXd& b,
                                  double threshold = 0.0);

/// Solves M x = right, M square, for every column. False if a pivot is less than `threshold` of the
/// largest.
bool solveSquare(const Eigen::MatrixXd& M, const Eigen::MatrixXd& right, double threshold,
                 Eigen::MatrixXd& x);

/// Returns an orthonormal basis of M's kernel. Counts pivots of less than `threshold` of the
/// largest as zero.
Eigen::MatrixXd findKernel(const Eigen::MatrixXd& M, double threshold);

/// Return these columns, or rows, of M, in this order. (Eigen before 3.4 has no list index.)
Eigen::MatrixXd chooseColumns(const Eigen::MatrixXd& M, const std::vector<int>& columns);
inline Eigen::MatrixXd chooseRows(const Eigen::MatrixXd& M, const std::vector<int>& rows) {
  return chooseColumns(M.transpose(), rows).transpose();
}

/// Returns eigenvalues (std::runtime_error where their iteration does not converge); those that are
/// 0 to rounding are exactly 0. `zero_index`, unless null, receives the size of the largest Jordan
/// block of 0; 0 for a regular M.
std::vector<std::complex<double>> findEigenvalues(Eigen::MatrixXd M, int* zero_index = nullptr);

}  // namespace variator_sim
