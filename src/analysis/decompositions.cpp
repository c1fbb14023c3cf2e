#include "analysis/decompositions.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace variator_sim {

using Eigen::MatrixXd;
using Eigen::VectorXd;

IndependentRows findIndependentRows(const MatrixXd& M, double threshold) {
  Eigen::ColPivHouseholderQR<MatrixXd> qr(M);
  qr.setThreshold(threshold);
  const auto rank = static_cast<int>(qr.rank());
  IndependentRows found;
  found.pivots.reserve(static_cast<std::size_t>(rank));
  const MatrixXd Q = qr.householderQ();
  found.transform = Q.leftCols(rank).transpose();
  for (int r = 0; r < rank; ++r) found.pivots.push_back(qr.colsPermutation().indices()(r));
  return found;
}

VectorXd solveLeastSquares(const MatrixXd& M, const VectorXd& b, double threshold) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition;
  if (threshold > 0.0) decomposition.setThreshold(threshold);
  decomposition.compute(M);
  return decomposition.solve(b);
}

bool solveSquare(const MatrixXd& M, const MatrixXd& right, double threshold, MatrixXd& x) {
  Eigen::ColPivHouseholderQR<MatrixXd> qr(M);
  qr.setThreshold(threshold);
  if (qr.rank() < M.cols()) return false;
  x = qr.solve(right);
  return true;
}

MatrixXd findKernel(const MatrixXd& M, double threshold) {
  // M^T P = Q R: what is left of Q is at right angles to all rows of M.
  Eigen::ColPivHouseholderQR<MatrixXd> qr(M.transpose());
  qr.setThreshold(threshold);
  const MatrixXd Q = qr.householderQ();
  return Q.rightCols(M.cols() - qr.rank());
}

std::vector<std::complex<double>> findEigenvalues(const MatrixXd& M) {
  const Eigen::EigenSolver<MatrixXd> solver(M, false);
  return {solver.eigenvalues().begin(), solver.eigenvalues().end()};
}

}  // namespace variator_sim
