/// Decompositions of dense matrices by LAPACK: Eigen's took a tenth of the package's build. Not for
/// the loop. Throws std::runtime_error where LAPACK finds no answer.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

namespace variator_sim {

/// Rows that are dependent left out, and the columns that the others can be solved for.
struct IndependentRows {
  Eigen::MatrixXd transform;  ///< rank x rows: independent combinations of the rows
  std::vector<int> pivots;    ///< as many columns
};

/// Pivots of less than `threshold` of the largest are none.
IndependentRows findIndependentRows(const Eigen::MatrixXd& M, double threshold);

/// x of least length among those of least |M x - b|. Pivots of less than `threshold` of the largest
/// are none; 0: what rounding leaves.
Eigen::VectorXd solveLeastSquares(const Eigen::MatrixXd& M, const Eigen::VectorXd& b,
                                  double threshold = 0.0);

/// Solves M x = right, M square, for every column. False where a pivot is less than `threshold` of
/// the largest.
bool solveSquare(const Eigen::MatrixXd& M, const Eigen::MatrixXd& right, double threshold,
                 Eigen::MatrixXd& x);

/// Columns of length 1, at right angles, that M makes 0. Pivots of less than `threshold` of the
/// largest are none.
Eigen::MatrixXd findKernel(const Eigen::MatrixXd& M, double threshold);

/// These columns, or rows, of M, in this order. (Eigen before 3.4 takes no list for an index.)
Eigen::MatrixXd chooseColumns(const Eigen::MatrixXd& M, const std::vector<int>& columns);
inline Eigen::MatrixXd chooseRows(const Eigen::MatrixXd& M, const std::vector<int>& rows) {
  return chooseColumns(M.transpose(), rows).transpose();
}

/// Eigenvalues that are 0 to rounding are exactly 0. `zero_index`, where it is not null: the size
/// of the largest Jordan block of 0; 0 where M is regular.
std::vector<std::complex<double>> findEigenvalues(Eigen::MatrixXd M, int* zero_index = nullptr);

}  // namespace variator_sim
