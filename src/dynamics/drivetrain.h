/// One scene, evaluated: torques, inertia, constraints, inputs. System (system.h) has the state and
/// the principle.
#pragma once

#include <algorithm>
#include <vector>

#include "dynamics/dense.h"
#include "dynamics/scene_program.h"
#include "dynamics/state_vector.h"
#include "variator_sim/principle.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Finds the component whose value is not finite at `state` (first torques, then constraints), for
/// messages. Returns false when all are finite.
bool findNonFinite(const Scene& scene, StateView state, int* torque, int* constraint);

/// The scene is constant; only the inputs' current closed forms and the inertia at the last
/// evaluated angle change. All evaluations are [loop].
class Drivetrain {
 public:
  /// `like`: the drivetrain of a scene with the same elements, or nullptr.
  explicit Drivetrain(const Scene& scene, const Drivetrain* like = nullptr);

  int shafts() const { return S; }
  const Inertia& inertia() const { return inertia_; }
  int constraintCount() const { return solver_.rowCount(); }
  int inputCount() const { return static_cast<int>(signals_.size()); }
  const Constraint& constraint(int m) const { return *constraints_[m]; }
  const ConstraintSolver& solver() const { return solver_; }
  /// True when some constraint is of order 1 (its velocities are projected too).
  bool hasVelocityRows() const { return !velocity_rows_.empty(); }
  /// True when some constraint is of order 1 or 2.
  bool hasAccelerationRows() const { return !acceleration_rows_.empty(); }
  const std::vector<int>& velocityRows() const { return velocity_rows_; }
  const std::vector<int>& accelerationRows() const { return acceleration_rows_; }
  /// The accelerations that some constraint is not linear in, bit i for shaft i.
  ShaftSet nonlinearAccelerations() const { return nonlinear_accelerations_; }
  /// The kinks of psi in epsilon: see Constraint::kinks.
  static constexpr std::size_t kMostKinks = 16;
  const std::vector<const Constraint*>& kinks() const { return kinks_; }
  /// True when C and J are the same at every state.
  bool hasConstantJacobian() const { return has_constant_jacobian_; }

  // --- inputs ----------------------------------------------------------------------------------
  void resetInputs();
  CommandSignal& signal(int input) { return signals_[static_cast<std::size_t>(input)]; }
  void setOrigin(double origin) { origin_ = origin; }
  /// Determines which inputs vary: the caller does this after a signal was changed and before an
  /// evaluation.
  void refreshInputs(double time);
  // --- evaluations -----------------------------------------------------------------------------
  /// Evaluates u and u' at t.
  void moveInputs(double t);
  /// Returns a view of (t, phi, omega, epsilon) with the inputs at t; updates J to phi.
  StateView view(double t, const double* phi, const double* omega, const double* epsilon) {
    moveInputs(t);
    if (!inertia_.isConstant()) inertia_.update(phi);
    return {origin_ + t, phi, omega, epsilon, input_, input_rate_, input_second_rate_};
  }

  /// The switching functions of all components.
  const std::vector<GuardPtr>& guards() const { return guards_; }
  /// The owner of a switching function: the index of a torque or of a constraint, the other one -1.
  struct GuardOwner {
    int torque;
    int constraint;
  };
  const GuardOwner& guardOwner(int guard) const {
    return guard_owners_[static_cast<std::size_t>(guard)];
  }
  /// Applied torque Q at `state`, N m, S values.
  void calcTorque(const StateView& state, double* torque) const {
    program_.calcTorque(state, torque);
  }
  /// Its total rate Q', N m/s, S values.
  void calcTorqueRate(const StateView& state, double* torque_rate) const {
    program_.calcTorqueRate(state, torque_rate);
  }

  /// Q - n, the torque that J epsilon would balance without reaction; n = 1/2 J' omega^2.
  void calcFreeTorque(const StateView& state, double* torque) const;
  void subtractInertialTorque(const StateView& state, double* torque) const;  // n
  /// Q' - J' omega epsilon - n', n' = 1/2 J'' omega^3 + J' omega epsilon: R' is J eta minus this
  /// rate.
  void calcFreeTorqueRate(const StateView& state, double* rate) const {
    calcTorqueRate(state, rate);
    if (!inertia_.isConstant()) addInertialRate(state, rate);
  }
  /// - J' omega epsilon - n'.
  void addInertialRate(const StateView& state, double* rate) const {
    for (int i = 0; i < S; ++i) {
      const double w = state.velocity[i];
      rate[i] -= 2.0 * inertia_.first(i) * w * state.acceleration[i] +
                 0.5 * inertia_.second(i) * w * w * w;
    }
  }
  /// Turns Q' in `rate` into -g = Q' - J' omega epsilon - n' + Gamma R omega [6]; Q' if J is
  /// constant.
  void makeCovariant(const StateView& state, double* rate) const {
    if (!inertia_.isConstant()) addCovariantRate(state, rate);
  }
  /// R = J epsilon + n - Q, S values, given Q.
  void calcReaction(const StateView& state, const double* torque, double* reaction) const;
  /// Gamma^rho_{i i} R_rho omega_i = 1/2 J_i' omega_i (J^-1 R)_i: the difference of R' and its
  /// covariant form G [6]. It is not zero only for an inertia that depends on the angle.
  void calcConnection(const StateView& state, const double* reaction, double* connection) const;

  /// Evaluates and factors C and c0 of all constraints. Returns false if C has lost rank.
  bool calcRows(const StateView& state, double* c0);

  /// One step of Newton's iteration onto f = 0 (orders 1) by the velocities, in the metric J:
  ///     delta omega = -J^-1 C^T A^-1 f.
  /// Writes delta (S values). False if C has lost rank.
  bool calcVelocityProjection(const StateView& state, double* delta);
  /// The same onto psi = 0 or f' = 0 (orders 2 and 1) by the accelerations.
  bool calcAccelerationProjection(const StateView& state, double* delta);
  /// True when the last projection had nearly dependent rows.
  bool areAccelerationRowsIll() const { return acceleration_solver_.isIll(); }
  /// The least-reaction accelerations of the second-order forms linearised at `state`:
  ///     free - J^-1 C^T A^-1 (psi + C (free - epsilon)),
  /// as the correction to `free` (S values each). False if C has lost rank.
  bool calcLinearizedReaction(const StateView& state, const double* free, double* delta);
  /// Squared length of row r of accelerationRows() in the last acceleration projection.
  double accelerationRowLengthSquared(int r) const {
    return acceleration_solver_.rowLengthSquared(r);
  }
  /// Index of the constraint at which the last projection lost rank.
  int singularVelocityConstraint() const {
    return rowOf(velocity_rows_, velocity_solver_.singularRow());
  }
  int singularAccelerationConstraint() const {
    return rowOf(acceleration_rows_, acceleration_solver_.singularRow());
  }

  /// The jerk that keeps R = C^T lambda, i.e. the derivative of J epsilon + n - Q = C^T lambda:
  ///     (J - sum lambda_m H_m) eta - C^T lambda' = free torque rate + sum lambda_m D_m,
  ///     C eta + c0 = 0,   dC/dt = D + H eta        [17, 18].
  /// `lambda` (k values) is given; eta and the reaction rate R' = J eta - free torque rate are
  /// written (S values each). False when the system is singular.
  bool calcFormalJerk(const StateView& state, const double* lambda, double* eta,
                      double* reaction_rate);

  /// lambda (k values) of the part of `reaction` in range(C^T): A lambda = C J^-1 R. Needs
  /// calcRows.
  void calcMultipliers(const double* reaction, double* lambda) const;
  /// The same, and `rest` = J^-1 (C^T lambda - R) (S values): the change of the accelerations that
  /// brings R into range(C^T). C rest = 0.
  void calcOutOfRange(const double* reaction, double* lambda, double* rest) const;

  /// See the function of this name above.
  bool findNonFinite(const StateView& state, int* torque, int* row) const {
    return variator_sim::findNonFinite(scene_, state, torque, row);
  }

 private:
  void setInput(int i, const CommandSignal::Moment& moment) {
    input_[i] = moment.value;
    input_rate_[i] = moment.rate;
    input_second_rate_[i] = moment.second_rate;
  }
  /// - J' omega epsilon - n' + Gamma R omega.
  void addCovariantRate(const StateView& state, double* rate) const;

  static int countOrders(const Scene& scene, int highest);
  template <class Law>
  void noteBranches(const Law& law, GuardOwner owner) {
    guards_.insert(guards_.end(), law.guards().begin(), law.guards().end());
    guard_owners_.resize(guards_.size(), owner);
  }
  static int rowOf(const std::vector<int>& rows, int row) {
    return row < 0 ? -1 : rows[static_cast<std::size_t>(row)];
  }

  /// H of constraint m, s by s.
  double* hessian(int m) { return hessians_.data() + m * S * S; }
  /// (J - sum lambda_m H_m) x - C^T y = right, C x = -c0, with the rows of C in solver_ and H in
  /// hessians_. Writes x.
  bool solveFormal(const double* lambda, const double* right, const double* c0, double* x) const;

  /// -J^-1 C^T A^-1 (residual + C shift) over the constraints of a level of `program_`; `shift` may
  /// be nullptr.
  bool calcCorrection(const double* level, const double* shift, ConstraintSolver* solver,
                      double* delta);

  const int S;  // shafts
  const Scene& scene_;
  Inertia inertia_;
  ConstraintSolver solver_;               // all constraints
  ConstraintSolver velocity_solver_;      // those of order 1
  ConstraintSolver acceleration_solver_;  // constraints of order 1 and 2
  SceneProgram program_;
  std::vector<const Torque*> torques_;
  std::vector<const Constraint*> constraints_;
  std::vector<const Constraint*> kinks_;
  ShaftSet nonlinear_accelerations_;
  std::vector<int> velocity_rows_;
  std::vector<int> acceleration_rows_;
  std::vector<CommandSignal> signals_;
  std::vector<int> varying_;  // indices of the inputs that are not constant; capacity is reserved
  double input_[kMaxInputs] = {};
  double input_rate_[kMaxInputs] = {};
  double input_second_rate_[kMaxInputs] = {};
  std::vector<GuardPtr> guards_;
  std::vector<GuardOwner> guard_owners_;
  std::vector<double> hessians_;  // of all constraints
  bool has_constant_jacobian_ = false;
  double origin_ = 0.0;  ///< origin of times, s
};

}  // namespace variator_sim
