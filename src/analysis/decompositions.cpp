#include "analysis/decompositions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace variator_sim {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// LAPACK's interface for Fortran (LAPACK Users' Guide, 3rd ed., 1999): columns one after the other,
// everything by address.
// NOLINTBEGIN(readability-identifier-naming): Fortran's names
extern "C" {
void dgeqp3_(const int* rows, const int* columns, double* A, const int* stride, int* pivots,
             double* tau, double* work, const int* work_size, int* info);
void dorgqr_(const int* rows, const int* columns, const int* reflectors, double* A,
             const int* stride, const double* tau, double* work, const int* work_size, int* info);
void dgelsy_(const int* rows, const int* columns, const int* sides, double* A, const int* stride,
             double* b, const int* stride_b, int* pivots, const double* threshold, int* rank,
             double* work, const int* work_size, int* info);
void dgeev_(const char* left, const char* right, const int* size, double* A, const int* stride,
            double* real, double* imaginary, double* left_vectors, const int* stride_left,
            double* right_vectors, const int* stride_right, double* work, const int* work_size,
            int* info);
}
// NOLINTEND(readability-identifier-naming)

namespace {

// Work space of a routine for matrices of this size, and its return code.
struct Work {
  explicit Work(Eigen::Index rows, Eigen::Index columns)
      : space(40 * (rows + columns + 1)), size(static_cast<int>(space.size())) {}
  void check(const char* routine) const {
    if (info == 0) return;
    throw std::runtime_error(std::string("LAPACK's ") + routine +
                             " failed: info = " + std::to_string(info));
  }
  VectorXd space;
  int size;
  int info = 0;
};

int count(Eigen::Index n) {
  return static_cast<int>(n);
}
int strideOf(const MatrixXd& M) {
  return std::max(1, count(M.rows()));
}

// M P = Q R with pivots that never grow, and the numerical rank.
struct PivotedQr {
  MatrixXd Q;               // rows x rows
  std::vector<int> pivots;  // from 0
  int rank = 0;
};

PivotedQr decompose(const MatrixXd& M, double threshold) {
  const int rows = count(M.rows());
  const int columns = count(M.cols());
  const int reflectors = std::min(rows, columns);
  PivotedQr qr;
  qr.pivots.assign(static_cast<std::size_t>(columns), 0);
  qr.Q = MatrixXd::Zero(rows, std::max(rows, columns));
  qr.Q.leftCols(columns) = M;
  const int stride = strideOf(qr.Q);
  VectorXd tau = VectorXd::Zero(std::max(1, reflectors));
  Work work(rows, columns);
  dgeqp3_(&rows, &columns, qr.Q.data(), &stride, qr.pivots.data(), tau.data(), work.space.data(),
          &work.size, &work.info);
  work.check("dgeqp3");
  for (int& pivot : qr.pivots) --pivot;
  while (qr.rank < reflectors &&
         std::abs(qr.Q(qr.rank, qr.rank)) > threshold * std::abs(qr.Q(0, 0))) {
    ++qr.rank;
  }
  dorgqr_(&rows, &rows, &reflectors, qr.Q.data(), &stride, tau.data(), work.space.data(),
          &work.size, &work.info);
  work.check("dorgqr");
  qr.Q.conservativeResize(rows, rows);
  return qr;
}

// Returns M's rank and the X of least length that minimizes |M X - right|. X is NaN if M or right
// is not finite, with which LAPACK may never end.
int solveShortest(MatrixXd M, const MatrixXd& right, double threshold, MatrixXd& X) {
  const int rows = count(M.rows());
  const int columns = count(M.cols());
  const int sides = count(right.cols());
  if (!M.allFinite() || !right.allFinite()) {
    X = MatrixXd::Constant(columns, sides, std::numeric_limits<double>::quiet_NaN());
    return 0;
  }
  X = MatrixXd::Zero(std::max(rows, columns), sides);
  X.topRows(rows) = right;
  std::vector<int> pivots(static_cast<std::size_t>(columns), 0);
  int rank = 0;
  const int stride = strideOf(M);
  const int stride_X = strideOf(X);
  Work work(rows + sides, columns);
  dgelsy_(&rows, &columns, &sides, M.data(), &stride, X.data(), &stride_X, pivots.data(),
          &threshold, &rank, work.space.data(), &work.size, &work.info);
  work.check("dgelsy");
  X.conservativeResize(columns, sides);
  if (rank == 0) X.setZero();
  return rank;
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

// Deflates some eigenvalues 0 of M: with columns N that span its kernel and Q = (N, N') orthogonal
//     Q^T M Q = (0 B; 0 M'),
// M' has the others, and a kernel again if 0 has Jordan blocks of two. Returns the number deflated.
// (Kublanovskaya, On a method of solving the complete eigenvalue problem for a degenerate matrix,
// USSR Comput. Math. Math. Phys. 6, 1966.)
int deflateZero(MatrixXd& M) {
  constexpr double kRounding = 1e-12;
  const auto size = M.rows();
  if (size == 0) return 0;
  // Small entries are no zeros: scale rows and columns to one length before the kernel is sought.
  MatrixXd scaled = M;
  VectorXd factors = VectorXd::Ones(size);
  for (int round = 0; round < 4; ++round) {
    for (int j = 0; j < size; ++j) {
      const double row = scaled.row(j).norm();
      if (row > 0.0) scaled.row(j) /= row;
      const double column = scaled.col(j).norm();
      if (!(column > 0.0)) continue;
      scaled.col(j) /= column;
      factors(j) /= column;
    }
  }
  const MatrixXd kernel = factors.asDiagonal() * findKernel(scaled, kRounding);
  if (kernel.cols() == 0) return 0;
  const MatrixXd rest = decompose(kernel, 0.0).Q.rightCols(size - kernel.cols());
  M = rest.transpose() * M * rest;
  return count(kernel.cols());
}

}  // namespace

IndependentRows findIndependentRows(const MatrixXd& M, double threshold) {
  const PivotedQr qr = decompose(M, threshold);
  return {qr.Q.leftCols(qr.rank).transpose(), {qr.pivots.begin(), qr.pivots.begin() + qr.rank}};
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
  // M^T P = Q R: the remaining columns of Q are orthogonal to all rows of M.
  const PivotedQr qr = decompose(M.transpose(), threshold);
  return qr.Q.rightCols(M.cols() - qr.rank);
}

MatrixXd chooseColumns(const MatrixXd& M, const std::vector<int>& columns) {
  MatrixXd chosen(M.rows(), count(static_cast<Eigen::Index>(columns.size())));
  for (std::size_t j = 0; j < columns.size(); ++j) {
    chosen.col(static_cast<Eigen::Index>(j)) = M.col(columns[j]);
  }
  return chosen;
}

std::vector<std::complex<double>> findEigenvalues(MatrixXd M, int* zero_index) {
  std::vector<std::complex<double>> values;
  int index = 0;
  if (M.allFinite()) {
    balance(M);
    while (const int zeros = deflateZero(M)) {
      values.insert(values.end(), static_cast<std::size_t>(zeros), std::complex<double>());
      ++index;
    }
  }
  if (zero_index != nullptr) *zero_index = index;
  const int size = count(M.rows());
  const int stride = strideOf(M);
  VectorXd real = VectorXd::Constant(size, std::numeric_limits<double>::quiet_NaN());
  VectorXd imaginary = real;
  double none = 0.0;
  const int one = 1;
  if (size > 0 && M.allFinite()) {
    Work work(size, size);
    dgeev_("N", "N", &size, M.data(), &stride, real.data(), imaginary.data(), &none, &one, &none,
           &one, work.space.data(), &work.size, &work.info);
    work.check("dgeev");
  }
  for (int i = 0; i < size; ++i) values.emplace_back(real(i), imaginary(i));
  return values;
}

}  // namespace variator_sim
