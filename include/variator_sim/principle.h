/// The generalized Gauss principle, solved in its symmetric form.
///
/// Among all jerks eta with C eta + c0 = 0 [12] the motion takes the one whose reaction changes
/// least: minimise 1/2 G^T J^-1 G, G = J eta + g (for constant J, g = -Q'). With the multipliers
/// Lambda,
///     eta_free = -J^-1 g
///     A Lambda = -(c0 + C eta_free),   A = C J^-1 C^T   (k x k, symmetric positive definite)
///     eta      = eta_free + J^-1 C^T Lambda.
/// For two shafts this is [12] with [15]; no component of C is ever divided by.
#pragma once

#include "variator_sim/inertia.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// Capacity for the rows of any drivetrain: k < s.
constexpr int kMaxRows = kMaxConstraints;

/// The linear algebra of k constraints over s shafts: rows of C, B = C J^-1 and A = C B^T as L D
/// L^T. All arrays have fixed size.
class ConstraintSolver {
 public:
  /// Pivots of A below this fraction of their diagonal entry count as zero: two rows of C then
  /// differ in direction (in the metric J^-1) by less than 1e-6, and half the digits of eta are
  /// lost.
  static constexpr double kRankTolerance = 1e-12;

  ConstraintSolver(int shafts, int k) : S(shafts), k_(shafts > 1 ? k : 0) {}
  int rowCount() const { return k_; }

  /// Returns row m of C, S values, to be written before `factor`.
  double* row(int m) { return C_[m]; }
  const double* row(int m) const { return C_[m]; }
  /// Returns A_mm, i.e. the squared length of row m of C in the metric J^-1. Valid after `factor`.
  double rowLengthSquared(int m) const { return A_diagonal_[m]; }
  /// Return, after `factor` returned false, the row at which rank is lost, and its pivot over its
  /// diagonal entry.
  int singularRow() const { return singular_row_; }
  double singularMeasure() const { return singular_measure_; }

  /// Returns the smallest pivot of A over its diagonal entry (1 when k < 2: a single row cannot be
  /// dependent), and its row. Valid after `factor` returned true.
  double calcSmallestPivot(int* row) const {
    double smallest = 1.0;
    *row = -1;
    for (int m = 1; m < rowCount(); ++m) {
      if (D_[m] < smallest * A_diagonal_[m]) {
        smallest = D_[m] / A_diagonal_[m];
        *row = m;
      }
    }
    return smallest;
  }

  /// Forms and factors A. Returns false when C has not full rank (or is not finite).
  bool factor(const Inertia& J) {
    is_ill_ = false;
    for (int m = 0; m < rowCount(); ++m) J.solve(C_[m], B_[m]);
    for (int m = 0; m < rowCount(); ++m) {
      // Sums begin with their first term: adding it to 0.0 would be an operation of its own.
      double diagonal = C_[m][0] * B_[m][0];
      for (int i = 1; i < S; ++i) diagonal += C_[m][i] * B_[m][i];
      A_diagonal_[m] = diagonal;
      double pivot = diagonal;
      for (int n = 0; n < m; ++n) {
        double entry = C_[m][0] * B_[n][0];
        for (int i = 1; i < S; ++i) entry += C_[m][i] * B_[n][i];
        for (int p = 0; p < n; ++p) entry -= L_[m][p] * D_[p] * L_[n][p];
        L_[m][n] = entry * D_inverse_[n];
        pivot -= L_[m][n] * entry;
      }
      D_[m] = pivot;
      D_inverse_[m] = 1.0 / pivot;  // started here, done when the solution needs it
      if (!(pivot > kRankTolerance * diagonal)) {
        singular_row_ = m;
        singular_measure_ = diagonal > 0.0 ? pivot / diagonal : 0.0;
        return false;
      }
      is_ill_ = is_ill_ || pivot < kIll * diagonal;
    }
    return true;
  }

  /// x = A^-1 b, k values each; `x` may be `b`.
  void solve(const double* b, double* x) const {
    for (int m = 0; m < rowCount(); ++m) {
      double value = b[m];
      for (int n = 0; n < m; ++n) value -= L_[m][n] * x[n];
      x[m] = value;
    }
    for (int m = 0; m < rowCount(); ++m) x[m] *= D_inverse_[m];
    for (int m = rowCount() - 1; m >= 0; --m) {
      for (int n = m + 1; n < rowCount(); ++n) x[m] -= L_[n][m] * x[n];
    }
  }

  /// Computes C v, k values.
  void multiply(const double* v, double* Cv) const {
    for (int m = 0; m < rowCount(); ++m) {
      double sum = C_[m][0] * v[0];
      for (int i = 1; i < S; ++i) sum += C_[m][i] * v[i];
      Cv[m] = sum;
    }
  }
  /// y += J^-1 C^T Lambda, S values.
  void addReaction(const double* Lambda, double* y) const {
    for (int m = 0; m < rowCount(); ++m) {
      for (int i = 0; i < S; ++i) y[i] += B_[m][i] * Lambda[m];
    }
  }

  /// Turns eta_free in `eta` (S values) into the constrained jerk for c0 (k values) and writes
  /// Lambda (k values) unless it is null. Needs `factor`.
  void constrain(const double* c0, double* eta, double* Lambda) const {
    multiply(eta, Lambda);
    for (int m = 0; m < rowCount(); ++m) Lambda[m] = -(c0[m] + Lambda[m]);
    solve(Lambda, Lambda);
    addReaction(Lambda, eta);
    if (is_ill_) refine(c0, eta, Lambda);
  }
  /// True when rows are so nearly dependent that A^-1 has lost digits that C has: one solution is
  /// then only an approximation.
  bool isIll() const { return is_ill_; }

 private:
  /// Refines the solution: A = C J^-1 C^T has the square of C's condition, but the residual of C
  /// eta + c0 is known to C's own precision, so a second solve restores the digits lost.
  void refine(const double* c0, double* eta, double* Lambda) const {
    for (int round = 0; round < 3; ++round) {
      double rest[kMaxRows] = {};
      multiply(eta, rest);
      for (int m = 0; m < rowCount(); ++m) rest[m] = -(c0[m] + rest[m]);
      solve(rest, rest);
      addReaction(rest, eta);
      for (int m = 0; m < rowCount(); ++m) Lambda[m] += rest[m];
    }
  }

  /// A pivot of this fraction of its diagonal entry costs six digits.
  static constexpr double kIll = 1e-6;

  const int S;  // shafts
  const int k_;
  bool is_ill_ = false;
  int singular_row_ = -1;
  double singular_measure_ = 0.0;
  double C_[kMaxRows][kMaxShafts] = {};
  double B_[kMaxRows][kMaxShafts] = {};
  double L_[kMaxRows][kMaxRows] = {};
  double D_[kMaxRows] = {};
  double D_inverse_[kMaxRows] = {};
  double A_diagonal_[kMaxRows] = {};
};

}  // namespace variator_sim
