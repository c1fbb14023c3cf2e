#include "model/symmetric_matrix.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "variator_sim/types.h"

namespace variator_sim {
namespace {

using Rows = std::array<std::array<double, kMaxShafts>, kMaxShafts>;

int sizeOf(const Eigen::MatrixXd& A) {
  return static_cast<int>(A.rows());
}

/// Returns rows and columns `first`, first + 1, ..., n - 1, 0, ..., first - 1 of A, in this order.
Rows turned(const Eigen::MatrixXd& A, int first) {
  const int n = sizeOf(A);
  Rows rows{};
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] =
          A((first + i) % n, (first + j) % n);
    }
  }
  return rows;
}

/// Returns D of A = L D L^T. If A is not positive definite, some entry is not above 0, and those
/// behind it are invalid.
std::array<double, kMaxShafts> calcPivots(const Rows& A, std::size_t n) {
  Rows L{};
  std::array<double, kMaxShafts> D{};
  for (std::size_t i = 0; i < n; ++i) {
    D[i] = A[i][i];
    for (std::size_t j = 0; j < i; ++j) {
      double entry = A[i][j];
      for (std::size_t p = 0; p < j; ++p) entry -= L[i][p] * D[p] * L[j][p];
      L[i][j] = entry / D[j];
      D[i] -= L[i][j] * entry;
    }
  }
  return D;
}

/// Replaces A by R^T A R with the rotation R in the plane of p and q that makes A_pq vanish.
void rotate(Rows& A, std::size_t n, std::size_t p, std::size_t q) {
  const double theta = (A[q][q] - A[p][p]) / (2.0 * A[p][q]);
  const double tangent =
      (theta < 0.0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
  const double cosine = 1.0 / std::sqrt(tangent * tangent + 1.0);
  const double sine = tangent * cosine;
  const double moved = tangent * A[p][q];
  A[p][p] -= moved;
  A[q][q] += moved;
  A[p][q] = A[q][p] = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (i == p || i == q) continue;
    const double of_p = A[i][p];
    const double of_q = A[i][q];
    A[i][p] = A[p][i] = cosine * of_p - sine * of_q;
    A[i][q] = A[q][i] = sine * of_p + cosine * of_q;
  }
}

}  // namespace

bool isPositiveDefinite(const Eigen::MatrixXd& A) {
  const auto n = static_cast<std::size_t>(sizeOf(A));
  const std::array<double, kMaxShafts> D = calcPivots(turned(A, 0), n);
  return std::all_of(D.begin(), D.begin() + sizeOf(A), [](double pivot) { return pivot > 0.0; });
}

// Jacobi's rotations: they converge quadratically, after some five rounds over all pairs.
double calcSmallestEigenvalue(const Eigen::MatrixXd& A) {
  constexpr int kRounds = 30;
  const auto n = static_cast<std::size_t>(sizeOf(A));
  Rows rows = turned(A, 0);
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t p = 0; p < n; ++p) {
      for (std::size_t q = p + 1; q < n; ++q) {
        if (rows[p][q] != 0.0) rotate(rows, n, p, q);
      }
    }
  }
  double smallest = rows[0][0];
  for (std::size_t i = 1; i < n; ++i) smallest = std::min(smallest, rows[i][i]);
  return smallest;
}

// It is the pivot of a row that is eliminated last.
double calcFreeDiagonal(const Eigen::MatrixXd& A, int i) {
  const int n = sizeOf(A);
  return calcPivots(turned(A, (i + 1) % n),
                    static_cast<std::size_t>(n))[static_cast<std::size_t>(n - 1)];
}

}  // namespace variator_sim
