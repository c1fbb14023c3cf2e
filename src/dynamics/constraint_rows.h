/// The rows of C of k constraints over s shafts, and A = C J^-1 C^T as L D L^T, which tells whether
/// they have full rank.
#pragma once

#include "dynamics/dense.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// Nothing here allocates.
class ConstraintRows {
 public:
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxConstraints, 1>;
  /// Pivots of A below this fraction of their diagonal entry count as zero: two rows of C then
  /// differ in direction (in the metric J^-1) by less than 1e-6.
  static constexpr double kRankTolerance = 1e-12;

  ConstraintRows(int shafts, int rows)
      : C_(rows, shafts), L_(rows, rows), D_(rows), A_diagonal_(rows) {}

  /// C, to be written before `factor`.
  auto& jacobian() { return C_; }

  /// Forms and factors A; `mobility` is J^-1. Returns false when C has not full rank (or is not
  /// finite).
  bool factor(const SquareMatrix& mobility) {
    B_ = mobility.lazyProduct(C_.transpose());
    for (int m = 0; m < C_.rows(); ++m) {
      A_diagonal_(m) = D_(m) = C_.row(m).dot(B_.col(m));
      for (int n = 0; n < m; ++n) {
        double entry = C_.row(m).dot(B_.col(n));
        for (int p = 0; p < n; ++p) entry -= L_(m, p) * D_(p) * L_(n, p);
        L_(m, n) = entry / D_(n);
        D_(m) -= L_(m, n) * entry;
      }
      weakest_ = m;
      if (!(D_(m) > kRankTolerance * A_diagonal_(m))) return false;
    }
    weakest_ = -1;
    for (int m = 1; m < C_.rows(); ++m) {
      if (rankOf(m) < rankLeft()) weakest_ = m;
    }
    return true;
  }
  /// The row that depends most on those before it, or at which `factor` has found rank lost; -1 if
  /// none does. rankLeft: its pivot over its diagonal entry.
  int weakest() const { return weakest_; }
  double rankLeft() const { return weakest_ < 0 ? 1.0 : rankOf(weakest_); }
  /// Returns the squared length of row m of C in the metric J^-1.
  double lengthSquared(int m) const { return A_diagonal_(m); }

  /// Returns A^-1 b.
  Vector solve(Vector x) const {
    const auto k = static_cast<int>(C_.rows());
    for (int m = 0; m < k; ++m) {
      for (int n = 0; n < m; ++n) x(m) -= L_(m, n) * x(n);
    }
    x = x.cwiseQuotient(D_);
    for (int m = k - 1; m >= 0; --m) {
      for (int n = m + 1; n < k; ++n) x(m) -= L_(n, m) * x(n);
    }
    return x;
  }
  /// J^-1 C^T
  const auto& toAccelerations() const { return B_; }

 private:
  double rankOf(int m) const { return A_diagonal_(m) > 0.0 ? D_(m) / A_diagonal_(m) : 0.0; }

  int weakest_ = -1;
  DenseMatrix C_;
  DenseMatrix B_;  ///< J^-1 C^T
  DenseMatrix L_;
  Vector D_;
  Vector A_diagonal_;
};

}  // namespace variator_sim
