/// The rows of C of k constraints over s shafts, and A = C J^-1 C^T as L D L^T, which tells whether
/// they have full rank.
#pragma once

#include "dynamics/dense.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// All arrays have fixed size.
class ConstraintRows {
 public:
  /// Pivots of A below this fraction of their diagonal entry count as zero: two rows of C then
  /// differ in direction (in the metric J^-1) by less than 1e-6.
  static constexpr double kRankTolerance = 1e-12;

  ConstraintRows(int shafts, int rows) : S(shafts), k_(rows) {}

  int count() const { return k_; }
  /// Returns row m of C, S values, to be written before `factor`.
  double* row(int m) { return C_[m]; }

  /// Forms and factors A; `mobility` is J^-1. Returns false when C has not full rank (or is not
  /// finite).
  bool factor(const SquareMatrix& mobility) {
    for (int m = 0; m < k_; ++m) {
      for (int i = 0; i < S; ++i) {
        B_[m][i] = 0.0;
        for (int j = 0; j < S; ++j) B_[m][i] += mobility(i, j) * C_[m][j];
      }
    }
    for (int m = 0; m < k_; ++m) {
      A_diagonal_[m] = multiply(m, m);
      D_[m] = A_diagonal_[m];
      for (int n = 0; n < m; ++n) {
        double entry = multiply(m, n);
        for (int p = 0; p < n; ++p) entry -= L_[m][p] * D_[p] * L_[n][p];
        L_[m][n] = entry / D_[n];
        D_[m] -= L_[m][n] * entry;
      }
      weakest_ = m;
      if (!(D_[m] > kRankTolerance * A_diagonal_[m])) return false;
    }
    weakest_ = -1;
    for (int m = 1; m < k_; ++m) {
      if (rankOf(m) < rankLeft()) weakest_ = m;
    }
    return true;
  }
  /// The row that depends most on those before it, or at which `factor` has found rank lost; -1 if
  /// none does. rankLeft: its pivot over its diagonal entry.
  int weakest() const { return weakest_; }
  double rankLeft() const { return weakest_ < 0 ? 1.0 : rankOf(weakest_); }
  /// Returns the squared length of row m of C in the metric J^-1.
  double lengthSquared(int m) const { return A_diagonal_[m]; }

  /// x = A^-1 b, k values each; `x` may be `b`.
  void solve(const double* b, double* x) const {
    for (int m = 0; m < k_; ++m) {
      x[m] = b[m];
      for (int n = 0; n < m; ++n) x[m] -= L_[m][n] * x[n];
    }
    for (int m = 0; m < k_; ++m) x[m] /= D_[m];
    for (int m = k_ - 1; m >= 0; --m) {
      for (int n = m + 1; n < k_; ++n) x[m] -= L_[n][m] * x[n];
    }
  }
  /// y += J^-1 C^T Lambda, S values.
  void addReaction(const double* Lambda, double* y) const {
    for (int m = 0; m < k_; ++m) {
      for (int i = 0; i < S; ++i) y[i] += B_[m][i] * Lambda[m];
    }
  }

 private:
  /// C_m J^-1 C_n^T
  double multiply(int m, int n) const {
    double sum = 0.0;
    for (int i = 0; i < S; ++i) sum += C_[m][i] * B_[n][i];
    return sum;
  }
  double rankOf(int m) const { return A_diagonal_[m] > 0.0 ? D_[m] / A_diagonal_[m] : 0.0; }

  const int S;  // shafts
  const int k_;
  int weakest_ = -1;
  double C_[kMaxConstraints][kMaxShafts] = {};
  double B_[kMaxConstraints][kMaxShafts] = {};
  double L_[kMaxConstraints][kMaxConstraints] = {};
  double D_[kMaxConstraints] = {};
  double A_diagonal_[kMaxConstraints] = {};
};

}  // namespace variator_sim
