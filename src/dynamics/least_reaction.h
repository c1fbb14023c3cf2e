/// Accelerations of least reaction at one instant, from a first guess: stationary points of
///     1/2 R^T J^-1 R,   R = J epsilon + n - Q,   under psi(epsilon) = 0,
/// that is, of the distance from the free accelerations J^-1 (Q - n) in the metric J.
#pragma once

#include <algorithm>

#include "dynamics/acceleration_constraints.h"

namespace variator_sim {

/// If psi is linear in pieces (abs, min, max of accelerations), the nearest point may be a corner
/// of psi = 0. There some functions are zero beside psi, the kinks (Constraint::kinks): they join
/// the constraints, with multipliers of their own. A set of kinks is a number, bit j for kink j.
class LeastReactionSolver {
 public:
  /// Accelerations count as consistent when the nearest point of psi = 0 is not further away than
  /// this, relative to max(1, |epsilon|): what is left of a value printed with ten digits.
  static constexpr double kConsistent = 1e-9;

  explicit LeastReactionSolver(AccelerationConstraints& constraints)
      : S(constraints.shafts()), constraints_(constraints) {}

  /// Stationarity under psi = 0 and the kinks of `corner` = 0,
  ///     J epsilon + n - Q - C^T lambda - (d kinks)^T mu = 0,
  /// by damped Newton from the accelerations in `epsilon` (S values) and the multipliers (S places:
  /// one per constraint, then one per kink of the corner). False when it does not converge to a
  /// point where psi is zero.
  bool solve(const StateView& given, unsigned corner, double* epsilon, double* multipliers);

  /// Calls `found(epsilon)` for every corner that the nearest kinks make, from `epsilon`.
  template <class Found>
  void solveCorners(const StateView& given, const double* epsilon, Found found) {
    int nearest[kMostMeeting];
    const int most = findNearestKinks(given, epsilon, nearest);
    for (unsigned pick = 1; pick < 1U << static_cast<unsigned>(most); ++pick) {
      unsigned set = 0;
      int size = constraints_.rowCount();
      for (int n = 0; n < most; ++n) {
        if (!contains(pick, n)) continue;
        set |= 1U << static_cast<unsigned>(nearest[n]);
        ++size;
      }
      if (size > S) continue;
      double corner[kMaxShafts];
      double multipliers[kMaxShafts] = {};
      std::copy_n(epsilon, S, corner);
      if (solve(given, set, corner, multipliers)) found(corner);
    }
  }

  /// Moves `epsilon`, to which `state` points, onto psi = 0 near by. False when that fails.
  bool retract(const StateView& state, double* epsilon);

  /// True when psi = 0 is as near to `state` as consistent accelerations have it.
  bool isConsistent(const StateView& state, double allowed = kConsistent);

 private:
  static constexpr int kMostKinks = static_cast<int>(AccelerationConstraints::kMostKinks);
  /// The number of nearest kinks that may meet in a corner that is examined.
  static constexpr int kMostMeeting = 4;
  using Matrix = DenseMatrix;
  using Vector = DenseVector;

  /// Writes the kinks nearest to `epsilon`, at most kMostMeeting, the nearest first; returns their
  /// number, 0 if one is not finite there.
  int findNearestKinks(const StateView& given, const double* epsilon, int* nearest) const;

  /// Returns true if kink j is in the set.
  static bool contains(unsigned set, int j) { return (set >> static_cast<unsigned>(j) & 1U) != 0U; }

  /// Newton's iteration onto psi = 0 by `epsilon`, to which `state` points. False if C loses rank,
  /// or it does not converge.
  bool project(const StateView& state, double* epsilon);

  /// The constraints, then the kinks of `corner`.
  void select(unsigned corner);

  /// The step (delta epsilon, delta multipliers) of Newton's iteration at (epsilon, multipliers).
  /// False when the matrix is singular or not finite.
  bool calcStep(const StateView& state, const double* epsilon, const double* multipliers,
                Vector* step);

  double calcLength(const Vector& step) const { return step.head(S).cwiseAbs().maxCoeff(); }

  bool isSmall(const Vector& step, const double* epsilon, double rounding) const;

  /// A row of C with this part of its squared length has vanished.
  static constexpr double kVanished = 1e-12;
  const int S;  // shafts
  AccelerationConstraints& constraints_;
  const Constraint* rows_[kMaxShafts] = {};
  int row_count_ = 0;
};

}  // namespace variator_sim
