/// The constraints of order 1 and 2 as conditions psi = 0 on the accelerations at one instant,
/// beside the inertia and the free torque there. All evaluations are [loop].
#pragma once

#include <vector>

#include "dynamics/constraint_rows.h"
#include "dynamics/inertia.h"
#include "variator_sim/scene.h"

namespace variator_sim {

class AccelerationConstraints {
 public:
  using Vector = Inertia::Vector;

  /// `scene` has to outlive it.
  explicit AccelerationConstraints(const Scene& scene);

  int shafts() const { return S; }
  int rowCount() const { return static_cast<int>(constraints_.size()); }
  const Constraint& row(int m) const { return *constraints_[static_cast<std::size_t>(m)]; }
  /// The accelerations that some constraint is not linear in, bit i for shaft i.
  ShaftSet nonlinear() const { return nonlinear_; }
  /// The kinks of psi in epsilon: see Constraint::kinks.
  static constexpr std::size_t kMostKinks = 16;
  const std::vector<const Constraint*>& kinks() const { return kinks_; }

  /// Takes J, Q and n from a state, whose accelerations are not read.
  void enter(const StateView& state);
  const SquareMatrix& inertia() const { return inertia_.matrix(); }
  const SquareMatrix& mobility() const { return mobility_; }  ///< J^-1
  /// Q - n, N m, which J epsilon would balance without reaction; n = 1/2 J' omega^2.
  const Vector& torque() const { return torque_; }
  const Vector& free() const { return free_; }  ///< J^-1 (Q - n), rad/s^2

  /// One step of Newton's iteration onto psi = 0 by the accelerations, in the metric J:
  ///     delta = -J^-1 C^T A^-1 psi.
  /// With `is_free` the accelerations of least reaction under the constraints linearised there,
  ///     free - J^-1 C^T A^-1 (psi + C (free - epsilon)),
  /// as the correction to `free`. False if C has lost rank.
  bool calcCorrection(const StateView& state, double* delta, bool is_free = false);
  /// lambda (one per row) of the part of R in range(C^T): A lambda = C J^-1 R. False if C has lost
  /// rank.
  bool calcMultipliers(const StateView& state, double* lambda);
  /// By so much may accelerations be off psi = 0 for the rounding of what psi reads: 1/tau times
  /// that of the velocities where a slip has the short time constant tau, say.
  double calcRounding(const StateView& state) const;
  /// Squared length of row m in the last of these.
  double rowLengthSquared(int m) const { return rows_.lengthSquared(m); }

 private:
  /// Finds psi and factors C at `state`.
  bool factor(const StateView& state);

  const int S;  // shafts
  const Scene& scene_;
  Inertia inertia_;
  SquareMatrix mobility_;
  Vector torque_;
  Vector free_;
  std::vector<const Constraint*> constraints_;
  std::vector<const Constraint*> kinks_;
  expression::Tape terms_;  ///< of each row, sum |dpsi/dx x| over all x that it reads
  ShaftSet nonlinear_;
  ConstraintRows rows_;
  ConstraintRows::Vector psi_;
};

}  // namespace variator_sim
