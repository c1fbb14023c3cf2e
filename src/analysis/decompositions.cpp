#include "analysis/decompositions.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace variator_sim {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Returns M's rank and the X of least length that minimizes |M X - right|. X is NaN if M or right
/// is not finite.
Eigen::Index solveShortest(const MatrixXd& M, const MatrixXd& right, double threshold,
                           MatrixXd& X) {
  if (!M.allFinite() || !right.allFinite()) {
    X = MatrixXd::Constant(M.cols(), right.cols(), std::numeric_limits<double>::quiet_NaN());
    return 0;
  }
  X = MatrixXd::Zero(M.cols(), right.cols());
  if (M.size() == 0) return 0;
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> factors;
  factors.setThreshold(threshold);
  factors.compute(M);
  if (factors.rank() > 0) X = factors.solve(right);
  return factors.rank();
}

// D^-1 M D with rows as long as columns, D of powers of two: rounds nothing. (Osborne, On
// pre-conditioning of matrices, J. ACM 7, 1960.)
void balance(MatrixXd& M) {
  constexpr int kSweeps = 10;
  for (int n = 0; n < kSweeps * M.rows(); ++n) {
    const auto i = n % M.rows();
    const double row = M.row(i).norm();
    const double column = M.col(i).norm();
    if (row == 0.0 || column == 0.0) continue;
    const double factor = std::exp2(std::round(0.5 * std::log2(row / column)));
    M.col(i) *= factor;
    M.row(i) /= factor;
  }
}

// Deflates some eigenvalues 0 of M: of rank r, M = G F with F, r independent rows of M, and G, by
// which all rows follow from them. F G has M's other eigenvalues, and each Jordan block of 0 is
// shorter by one (Flanders, Elementary divisors of AB and BA, Proc. AMS 2, 1951). Returns the
// number deflated. G and F G get exact zeros where only rounding stands: the scaling of the next
// call would make it as large as other entries.
int deflateZero(MatrixXd& M) {
  constexpr double kRounding = 1e-12;
  constexpr double kCancelled = 1e-14;
  balance(M);
  const auto size = M.rows();
  // Small entries are no zeros: scale rows and columns to one length before rows are compared.
  MatrixXd scaled = M;
  VectorXd factors = VectorXd::Ones(size);
  for (int round = 0; round < 4; ++round) {
    for (int j = 0; j < size; ++j) {
      const double row = scaled.row(j).norm();
      if (row > 0.0) {
        scaled.row(j) /= row;
        factors(j) *= row;
      }
      const double column = scaled.col(j).norm();
      if (column > 0.0) scaled.col(j) /= column;
    }
  }
  const std::vector<int> kept = findIndependentRows(scaled.transpose(), kRounding).pivots;
  const auto rank = static_cast<Eigen::Index>(kept.size());
  if (rank == size) return 0;
  MatrixXd G;
  solveShortest(chooseRows(scaled, kept).transpose(), scaled.transpose(), kRounding, G);
  G.transposeInPlace();
  G = (G.array().abs() > kRounding).select(G, 0.0);
  G = factors.asDiagonal() * G;
  for (Eigen::Index j = 0; j < rank; ++j) {
    G.col(j) /= factors(kept[static_cast<std::size_t>(j)]);
    G.row(kept[static_cast<std::size_t>(j)]) = MatrixXd::Identity(rank, rank).row(j);
  }
  const MatrixXd F = chooseRows(M, kept);
  const MatrixXd product = F * G;
  const MatrixXd terms = F.cwiseAbs() * G.cwiseAbs();
  M = (product.array().abs() > kCancelled * terms.array()).select(product, 0.0);
  return static_cast<int>(size - rank);
}

}  // namespace

IndependentRows findIndependentRows(const MatrixXd& M, double threshold) {
  if (M.size() == 0) return {MatrixXd(0, M.rows()), {}};
  Eigen::ColPivHouseholderQR<MatrixXd> qr(M);
  qr.setThreshold(threshold);
  const MatrixXd Q = qr.householderQ();
  const auto* const pivots = qr.colsPermutation().indices().data();
  return {Q.leftCols(qr.rank()).transpose(), {pivots, pivots + qr.rank()}};
}

VectorXd solveLeastSquares(const MatrixXd& M, const VectorXd& b, double threshold) {
  const double rounding = std::numeric_limits<double>::epsilon() *
                          static_cast<double>(std::max<Eigen::Index>({1, M.rows(), M.cols()}));
  MatrixXd x;
  solveShortest(M, b, threshold > 0.0 ? threshold : rounding, x);
  return x;
}

bool solveSquare(const MatrixXd& M, const MatrixXd& right, double threshold, MatrixXd& x) {
  return solveShortest(M, right, threshold, x) == M.cols();
}

MatrixXd findKernel(const MatrixXd& M, double threshold) {
  if (M.size() == 0) return MatrixXd::Identity(M.cols(), M.cols());
  // M^T P = Q R: the remaining columns of Q are orthogonal to all rows of M.
  Eigen::ColPivHouseholderQR<MatrixXd> qr(M.transpose());
  qr.setThreshold(threshold);
  const MatrixXd Q = qr.householderQ();
  return Q.rightCols(M.cols() - qr.rank());
}

MatrixXd chooseColumns(const MatrixXd& M, const std::vector<int>& columns) {
  MatrixXd chosen(M.rows(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t j = 0; j < columns.size(); ++j) {
    chosen.col(static_cast<Eigen::Index>(j)) = M.col(columns[j]);
  }
  return chosen;
}

std::vector<std::complex<double>> findEigenvalues(MatrixXd M, int* zero_index) {
  std::vector<std::complex<double>> values;
  int index = 0;
  const bool is_finite = M.allFinite();
  if (is_finite) {
    while (const int zeros = deflateZero(M)) {
      values.insert(values.end(), static_cast<std::size_t>(zeros), std::complex<double>());
      ++index;
    }
  }
  if (zero_index != nullptr) *zero_index = index;
  Eigen::VectorXcd others =
      Eigen::VectorXcd::Constant(M.rows(), std::numeric_limits<double>::quiet_NaN());
  if (is_finite && M.size() > 0) {
    const Eigen::EigenSolver<MatrixXd> solver(M, false);
    if (solver.info() != Eigen::Success) {
      throw std::runtime_error("the iteration for the eigenvalues does not converge");
    }
    others = solver.eigenvalues();
  }
  values.insert(values.end(), others.data(), others.data() + others.size());
  return values;
}

}  // namespace variator_sim
