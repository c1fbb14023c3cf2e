/// Accelerations of least reaction at one instant, from a first guess: stationary points of
///     1/2 R^T J^-1 R,   R = J epsilon + n - Q,   under psi(epsilon) = 0,
/// that is, of the distance from the free accelerations J^-1 (Q - n) in the metric J.
#pragma once

#include <algorithm>

#include "dynamics/drivetrain.h"
#include "dynamics/projection.h"

namespace variator_sim {

/// If psi is piecewise linear (abs, min, max of accelerations), the nearest point may be a corner
/// of psi = 0. Some functions beside psi are zero there, the kinks (Constraint::kinks): they join
/// the constraints, with their own multipliers. A set of kinks is a number, bit j for kink j.
class LeastReactionSolver {
 public:
  /// Largest distance of consistent accelerations from psi = 0, relative to max(1, |epsilon|): the
  /// rounding of values printed with ten digits.
  static constexpr double kConsistent = 1e-9;

  explicit LeastReactionSolver(Drivetrain& drivetrain)
      : S(drivetrain.shafts()), drivetrain_(drivetrain) {}

  /// Solves for stationarity under psi = 0 and the kinks of `corner` = 0,
  ///     J epsilon + n - Q - C^T lambda - (d kinks)^T mu = 0,
  /// by damped Newton from the accelerations in `epsilon` (S values) and the multipliers (S places:
  /// one per row of accelerationRows(), then one per kink of the corner); `torque` is Q - n.
  /// Returns false without convergence to a point with psi = 0.
  bool solve(const StateView& given, const double* torque, unsigned corner, double* epsilon,
             double* multipliers);

  /// Finds the stationary point that continues the one in `epsilon` (S values, slightly earlier):
  /// on the same piece of psi, in the same corner, or the nearest one beyond. `corner` gets its
  /// kinks.
  bool continueFrom(const StateView& given, const double* torque, double* epsilon,
                    double* multipliers, unsigned* corner);

  /// Calls `found(epsilon)` for every corner that the nearest kinks make, from `epsilon`.
  template <class Found>
  void solveCorners(const StateView& given, const double* torque, const double* epsilon,
                    Found found) {
    if (drivetrain_.kinks().empty()) return;
    KinkValues values;
    if (!calcKinks(given, epsilon, &values)) return;
    forEachCorner(values, [&](unsigned set) {
      double corner[kMaxShafts];
      double multipliers[kMaxShafts] = {};
      std::copy_n(epsilon, S, corner);
      if (solve(given, torque, set, corner, multipliers)) found(corner);
    });
  }

  /// The jerk that follows the stationary point at `state` in its corner, and R': the derivative of
  /// J epsilon + n - Q = C^T lambda + (d kinks)^T mu beside that of psi = 0, kinks = 0:
  ///     (J - sum lambda_m H_m) eta - C^T lambda' = free torque rate + sum lambda_m D_m,
  ///     C eta + c0 = 0,   dC/dt = D + H eta.
  bool calcJerk(const StateView& state, unsigned corner, const double* multipliers, double* eta,
                double* reaction_rate);

  /// Moves `epsilon`, to which `state` points, onto psi = 0 near by. Returns false on failure.
  bool retract(const StateView& state, double* epsilon);

  /// True when psi = 0 is within the distance of consistent accelerations from `state`.
  bool isConsistent(const StateView& state, double allowed = kConsistent);

 private:
  static constexpr int kMostKinks = static_cast<int>(Drivetrain::kMostKinks);
  /// Number of nearest kinks that may meet in an examined corner.
  static constexpr int kMostMeeting = 4;
  using Matrix = DenseMatrix;
  using Vector = DenseVector;

  struct Point {
    double epsilon[kMaxShafts];
    double multipliers[kMaxShafts];
    unsigned corner;
  };
  struct KinkValues {
    double epsilon[kMaxShafts] = {};
    int count = 0;
    int nearest[kMostKinks] = {};      ///< kinks, the nearest first
    double distance[kMostKinks] = {};  ///< from epsilon, by kink
    double gradient[kMostKinks][kMaxShafts] = {};
    unsigned sides = 0;  ///< kinks with a value above 0
    double scale = 0.0;  ///< of epsilon
    /// The kinks that epsilon lies on.
    unsigned zeros() const {
      unsigned set = 0;
      for (int n = 0; n < count; ++n) {
        if (distance[nearest[n]] <= kConsistent * scale)
          set |= 1U << static_cast<unsigned>(nearest[n]);
      }
      return set;
    }
  };

  bool calcKinks(const StateView& given, const double* epsilon, KinkValues* values) const;

  /// Distance of accelerations from psi = 0 through rounding of psi's operands: for example 1/tau
  /// times that of the velocities if a slip has the short time constant tau.
  double calcRounding(const StateView& state) const;

  /// Calls `visit` with every set of the nearest kinks that leaves at most S equations.
  template <class Visit>
  void forEachCorner(const KinkValues& values, Visit visit) const {
    const int most = std::min(values.count, kMostMeeting);
    const int room = S - static_cast<int>(drivetrain_.accelerationRows().size());
    for (unsigned pick = 1; pick < 1U << static_cast<unsigned>(most); ++pick) {
      unsigned set = 0;
      int size = 0;
      for (int n = 0; n < most; ++n) {
        if ((pick >> static_cast<unsigned>(n) & 1U) == 0U) continue;
        set |= 1U << static_cast<unsigned>(values.nearest[n]);
        ++size;
      }
      if (size <= room) visit(set);
    }
  }

  /// Calls `visit` with every subset of `set`: the kinks above which a side lies.
  template <class Visit>
  static void forEachPattern(unsigned set, Visit visit) {
    if (set == 0) return;
    for (unsigned above = set;; above = (above - 1U) & set) {
      visit(above);
      if (above == 0) return;
    }
  }
  /// Returns true if a set contains kink j.
  static bool contains(unsigned set, int j) { return (set >> static_cast<unsigned>(j) & 1U) != 0U; }
  /// Returns epsilon moved off the kinks in `set` by kAside of its size, above those in `above`.
  Vector calcAside(const KinkValues& values, unsigned set, unsigned above) const;

  /// True when the reaction does not decrease from the stationary point in a corner to any of its
  /// sides: on each side -R lies in the cone of the normals there,
  ///     R = C^T lambda + sum nu_j n_j,   nu_j >= 0,
  /// with the C of that side and n_j the derivative of kink j, which leads into it.
  bool isLeastAtCorner(const StateView& given, const double* torque, const Point& point);

  const Constraint* rowOf(int m) const {
    return &drivetrain_.constraint(drivetrain_.accelerationRows()[static_cast<std::size_t>(m)]);
  }

  /// Selects the rows of accelerationRows(), then the kinks of `corner`.
  void select(unsigned corner);

  /// Computes the Newton step (delta epsilon, delta multipliers) at (epsilon, multipliers). Returns
  /// false when the matrix is singular or not finite.
  bool calcStep(const StateView& state, const double* torque, const double* epsilon,
                const double* multipliers, Vector* step);

  /// Returns a matrix for the accelerations and one multiplier per row that contains J.
  Matrix makeInertiaBlock() const;
  /// Adds C, -C^T and - multiplier H of row m.
  void addRow(int m, const double* C, const double* H, double multiplier, Matrix* K) const;

  double calcLength(const Vector& step) const { return step.head(S).cwiseAbs().maxCoeff(); }

  bool isSmall(const Vector& step, const double* epsilon, double rounding) const;

  /// A row of C with this part of its squared length has vanished.
  static constexpr double kVanished = 1e-12;
  /// Distance from a corner, relative to epsilon, at which its sides are examined.
  static constexpr double kAside = 1e-10;

  const int S;  // shafts
  Drivetrain& drivetrain_;
  const Constraint* rows_[kMaxShafts] = {};
  int row_count_ = 0;
};

}  // namespace variator_sim
