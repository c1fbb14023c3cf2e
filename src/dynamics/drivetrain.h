/// One scene, evaluated: torques, inertia, constraints, inputs. System (system.h) has the state and
/// the principle.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "dynamics/dense.h"
#include "dynamics/scene_program.h"
#include "dynamics/shaft_count.h"
#include "dynamics/shortcuts.h"
#include "dynamics/state_vector.h"
#include "model/central_difference.h"
#include "variator_sim/principle.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Finds the component whose value is not finite at `state` (first torques, then constraints), for
/// messages. Returns false when all are finite.
bool findNonFinite(const Scene& scene, StateView state, int* torque, int* constraint);

/// The scene is constant; only the inputs' current closed forms, the inertia at the last evaluated
/// angle and the counters change. All evaluations are [loop].
class Drivetrain {
 public:
  /// `like`: the drivetrain of a scene with the same elements, or nullptr.
  Drivetrain(const Scene& scene, const Shortcuts& shortcuts, const Drivetrain* like = nullptr);

  int shafts() const { return S; }
  const Inertia& inertia() const { return inertia_; }
  /// Returns the ratio of absolute and relative tolerance, against which state values are small.
  double naturalSize() const {
    return scene_.solver.absolute_tolerance / scene_.solver.relative_tolerance;
  }
  int constraintCount() const { return solver_.rowCount(); }
  int inputCount() const { return static_cast<int>(signals_.size()); }
  const Constraint& constraint(int m) const { return *constraints_[m]; }
  const ConstraintSolver& solver() const { return solver_; }
  std::uint64_t rightHandSides() const { return right_hand_sides_; }
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
  bool hasOrder3() const { return static_cast<int>(acceleration_rows_.size()) < constraintCount(); }

  // --- evaluations that can be skipped (decided once, at load) ---
  /// True when a derivative of the state depends on an angle; otherwise the angles are a
  /// quadrature.
  bool readsAngles() const { return reads_.angle; }
  /// True when a derivative of the state depends on the time, possibly through an input that moves.
  bool readsTime() const { return reads_.time || !varying_.empty(); }
  /// True when C and J are the same at every state.
  bool hasConstantJacobian() const { return has_constant_jacobian_; }
  /// False when no constraint's formula has the highest derivative of shaft i.
  bool readsColumn(int i) const { return reads_column_[i]; }
  /// Resets the counters of right-hand sides and Newton iterations.
  void resetCounts();

  // --- inputs ----------------------------------------------------------------------------------
  void resetInputs();
  CommandSignal& signal(int input) { return signals_[static_cast<std::size_t>(input)]; }
  const CommandSignal* signals() const { return signals_.data(); }
  const double* inputs() const { return input_; }
  const double* inputRates() const { return input_rate_; }
  const double* inputSecondRates() const { return input_second_rate_; }
  /// Saves all signals, and restores them at `time`.
  void saveSignals() { std::copy(signals_.begin(), signals_.end(), saved_signals_.begin()); }
  void restoreSignals(double time);
  /// Moves the origin of times `by` seconds later; laws receive the sum of origin and time.
  void moveOrigin(double by) {
    for (CommandSignal& signal : signals_) signal.moveOrigin(by);
  }
  void setOrigin(double origin) { origin_ = origin; }
  double origin() const { return origin_; }
  /// Re-evaluates every u and u' at `time` and determines which of them vary: the caller does this
  /// after a signal was changed and before an evaluation.
  void refreshInputs(double time);
  /// Encloses every input between two times of their closed forms. [loop]
  void encloseInputs(double from, double to, Interval* inputs) const;
  /// The time, s, at which the first of the inputs' closed forms ends.
  double inputSegmentEnd() const;
  /// At `time`, advances the inputs whose closed form ends until `latest` to their next one.
  void finishInputSegments(double time, double latest);

  /// Returns T = 1/2 omega^T J omega, J; updates J to phi.
  double calcKineticEnergy(const double* phi, const double* omega);

  // --- evaluations -----------------------------------------------------------------------------
  // Evaluates u and u' at t.
  void evaluateInputs(double t) {
    if (!varying_.empty()) moveInputs(t);
  }
  void moveInputs(double t);
  /// Returns a view of (t, phi, omega, epsilon) with the inputs at t; updates J to phi.
  StateView view(double t, const double* phi, const double* omega, const double* epsilon) {
    evaluateInputs(t);
    if (!inertia_.isConstant()) inertia_.update(phi);
    return {origin_ + t, phi, omega, epsilon, input_, input_rate_, input_second_rate_};
  }

  /// The jerk of a scene with one constraint and a simple inertia at x = (phi, omega, epsilon), the
  /// formulas of principle.h in local variables: most runs spend their time here, and numbers in
  /// the solver's memory cost store and load latency. Torques come before the row, whose result is
  /// needed last. Returns false, without effect, if A is not positive.
  template <int kShafts>
  bool calcJerkOfOneRow(double t, const double* x, double* eta) {
    ++right_hand_sides_;
    evaluateInputs(t);
    view_.time = origin_ + t;
    view_.angle = x;
    view_.velocity = x + kShafts;
    view_.acceleration = x + 2 * kShafts;
    const double* const rate = program_.calcRateAndRows(view_);
    const double* C = rate + kShafts;
    const double c0 = C[kShafts];
    // B = C J^-1, A = B C^T, eta_free = J^-1 Q'
    double B[kShafts];
    double free[kShafts];
    for (int i = 0; i < kShafts; ++i) {
      B[i] = C[i] * inertia_.inverse(i);
      free[i] = rate[i] * inertia_.inverse(i);
    }
    double A = B[0] * C[0];
    double right = C[0] * free[0];
    for (int i = 1; i < kShafts; ++i) {
      A += B[i] * C[i];
      right += C[i] * free[i];
    }
    if (!(A > 0.0)) {
      --right_hand_sides_;
      return false;
    }
    const double Lambda = -(c0 + right) / A;
    for (int i = 0; i < kShafts; ++i) eta[i] = free[i] + B[i] * Lambda;
    std::copy_n(C, kShafts, solver_.row(0));
    std::copy_n(rate, kShafts, torque_rate_);
    solver_.noteLengthSquared(0, A);
    return true;
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
  /// Returns the first instant after `time`, s, at which a law is not smooth; infinity if none.
  double nextInstant(double time) const;

  void countRightHandSide() { ++right_hand_sides_; }
  /// Counts one Newton iteration for the accelerations of least reaction.
  void countNewtonIteration() { ++newton_iterations_; }
  std::uint64_t newtonIterations() const { return newton_iterations_; }

  /// Applied torque Q at `state`, N m, S values.
  void calcTorque(const StateView& state, double* torque) const {
    program_.calcTorque(state, torque);
  }
  /// Its total rate Q', N m/s, S values.
  void calcTorqueRate(const StateView& state, double* torque_rate) const {
    calcTorqueRate(S, state, torque_rate);
  }
  template <class Count>
  void calcTorqueRate(Count shafts, const StateView& state, double* torque_rate) const {
    program_.calcTorqueRate(state, torque_rate);
    for (int i = 0; i < shafts; ++i) torque_rate_[i] = torque_rate[i];
  }
  /// True when Q reads the time itself.
  bool torquesReadTime() const { return torques_read_time_; }
  /// The last result of calcTorqueRate, for example at the last derivative of a state.
  const double* torqueRate() const { return torque_rate_; }
  bool hasTorques() const { return !torques_.empty(); }

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
  bool calcRows(const StateView& state, double* c0) { return calcRows(S, state, c0); }
  template <class Count>
  bool calcRows(Count shafts, const StateView& state, double* c0) {
    return takeRows(shafts, program_.calcRows(state), c0);
  }

  /// The same, and Q' as in calcTorqueRate, in one program.
  template <class Count>
  bool calcRowsAndTorqueRate(Count shafts, const StateView& state, double* c0, double* rate) {
    const double* values = program_.calcRateAndRows(state);
    for (int i = 0; i < shafts; ++i) rate[i] = values[i];
    for (int i = 0; i < shafts; ++i) torque_rate_[i] = rate[i];
    return takeRows(shafts, values + shafts, c0);
  }

  /// One step of Newton's iteration onto f = 0 (orders 1) by the velocities, in the metric J:
  ///     delta omega = -J^-1 C^T A^-1 f.
  /// Writes delta (S values). False if C has lost rank.
  bool calcVelocityProjection(const StateView& state, double* delta);
  /// The same onto psi = 0 or f' = 0 (orders 2 and 1) by the accelerations.
  bool calcAccelerationProjection(const StateView& state, double* delta);
  /// True when the last projection had nearly dependent rows.
  bool areAccelerationRowsIll() const { return acceleration_solver_.isIll(); }
  /// One step of Newton's iteration onto psi = 0 by velocities and accelerations together, for
  /// scenes without constraints of order 1. If psi changes much more with a velocity than with an
  /// acceleration (a short slip time constant tau), accelerations alone would have to compensate
  /// every rounding of the velocities, 1/tau times as large. Among all (delta omega, delta epsilon)
  /// that lead to the linearised psi = 0 this is the one with the least
  ///     delta_omega^T J delta_omega / h^2 + delta_epsilon^T J delta_epsilon,
  /// h the step: delta epsilon = -J^-1 C^T l, delta omega = -h^2 J^-1 B^T l, B = dpsi/domega,
  ///     (C J^-1 C^T + h^2 B J^-1 B^T) l = psi.
  /// Writes `delta`: S velocities, then S accelerations. False if the matrix is singular.
  bool calcStiffProjection(const StateView& state, double h, double* delta);

  /// True when implicit steps may keep psi = 0 in their stages instead of C eta + c0 = 0: all
  /// constraints are of order 2.
  bool canKeepConstraintsInStages() const {
    return keeps_constraints_in_stages_ && constraintCount() > 0;
  }

  /// The motion as an implicit equation, free of the 1/tau of a stiff constraint: with D =
  /// J^-1 C^T A^-1 and the projector P = I - D C onto the jerks that C leaves free,
  ///     residual = P0 P (eta - eta_free) + D0 psi
  /// is zero where eta obeys the principle and psi = 0. P0 and D0 are P and D at the beginning of
  /// the step (S x S; S values per constraint): P and D rotate with C, and 1/tau or 1/h times the
  /// rotation would mix the two parts. Returns false if C has lost rank.
  bool calcStageResidual(const StateView& state, const double* eta, const SquareMatrix& P0,
                         const SquareMatrix& D0, double* residual);

  /// Its derivatives where it is zero and the multipliers are `Lambda`: by eta, P (`projector`),
  /// and by (phi, omega, epsilon), 3S directions of S values,
  ///     -P J^-1 (Q'_q + C_q^T Lambda) + D psi_q;   and D (`pull`).
  /// The change of J with the angles is neglected: it is never stiff, and the derivatives only
  /// direct Newton's iteration.
  void calcStageDerivatives(const StateView& state, const double* Lambda, SquareMatrix& projector,
                            SquareMatrix& pull, double* derivatives);

  /// The same one order lower, for the classical principle with constraints linear in epsilon: the
  /// stages' unknown is epsilon itself,
  ///     residual = P0 P (epsilon - epsilon_free) + D0 psi(t, phi, omega, epsilon),
  /// free of the 1/tau that epsilon(t, phi, omega) has in it.
  bool calcAccelerationResidual(const StateView& state, const SquareMatrix& P0,
                                const SquareMatrix& D0, double* residual);
  /// Its derivatives by (phi, omega), 2S directions of S values, where it is zero and the
  /// multipliers are `lambda`: -P J^-1 (Q_q + C_q^T lambda) + D psi_q. That by epsilon is
  /// P + D C = I.
  void calcAccelerationDerivatives(const StateView& state, const double* lambda,
                                   SquareMatrix& projector, SquareMatrix& pull,
                                   double* derivatives);

  /// d eta/d(phi, omega, epsilon) at `state`, where the jerk is `eta` and the multipliers `Lambda`,
  /// for a constant inertia: 3S directions of S values each. Differentiating
  ///     J eta - C^T Lambda = Q',   C eta = -c0
  /// in direction q gives the same system with other right sides,
  ///     J eta_q - C^T Lambda_q = Q'_q + C_q^T Lambda,   C eta_q = -(c0_q + C_q eta).
  /// Needs calcRows at `state`.
  void calcJerkDerivatives(const StateView& state, const double* eta, const double* Lambda,
                           double* derivatives) const;

  /// The least-reaction accelerations of the second-order forms linearised at `state`:
  ///     free - J^-1 C^T A^-1 (psi + C (free - epsilon)),
  /// as the correction to `free` (S values each). False if C has lost rank.
  bool calcLinearizedReaction(const StateView& state, const double* free, double* delta);
  /// Squared length of row r of accelerationRows() in the last acceleration projection.
  double accelerationRowLengthSquared(int r) const {
    return acceleration_solver_.rowLengthSquared(r);
  }
  const double* accelerationRow(int r) const { return acceleration_solver_.row(r); }
  /// Estimates the effect of rounding of time, angles, velocities and accelerations at `state` on a
  /// projection onto the constraints: on each velocity and each acceleration (S values each).
  /// Residuals are evaluated at states perturbed by a few roundings. Needs the last projection's
  /// rows. Not cheap; for steps with large estimated errors.
  void calcProjectionRounding(const StateView& state, double* velocity, double* acceleration);
  /// Index of the constraint at which the last projection lost rank.
  int singularVelocityConstraint() const {
    return rowOf(velocity_rows_, velocity_solver_.singularRow());
  }
  int singularAccelerationConstraint() const {
    return rowOf(acceleration_rows_, acceleration_solver_.singularRow());
  }

  /// d epsilon / d theta of the jump map at `state`, whose inputs stand at theta:
  ///     C d_epsilon + dpsi/du Delta_u = 0,   J d_epsilon = Delta_Q + C^T Lambda.
  /// False if C has lost rank; the rate is NaN then.
  bool calcJumpRate(const StateView& state, const double* torque_jump, const double* input_jump,
                    double* rate);

  /// The effect of a kink of constraints of order 1 on the accelerations: f' is f0'(e) = C0 e + b0
  /// `before` it and f1'(e) = C1 e + b1 `after`. A smooth f would pass from one to the other in a
  /// vanishing time, with the weight theta of the second rising from 0 to 1, and its large f''
  /// would require a large Lambda, while psi of order 2 stays 0 and order 3 keeps its C:
  ///     C(theta, e) = (1 - theta) C0(e) + theta C1(e),   J de/dtheta = C^T Lambda,
  ///     C de/dtheta + f1'(e) - f0'(e) = 0.
  /// Writes the change of epsilon (S values). False if C loses rank.
  bool calcKinkJump(StateView before, StateView after, double* change);

  /// The jerk that keeps R = C^T lambda, i.e. the derivative of J epsilon + n - Q = C^T lambda:
  ///     (J - sum lambda_m H_m) eta - C^T lambda' = free torque rate + sum lambda_m D_m,
  ///     C eta + c0 = 0,   dC/dt = D + H eta        [17, 18].
  /// `lambda` (k values) is given; eta and the reaction rate R' = J eta - free torque rate are
  /// written (S values each). False when the system is singular.
  bool calcFormalJerk(const StateView& state, const double* lambda, double* eta,
                      double* reaction_rate);

  /// d epsilon / d theta of a jump along which R stays C^T lambda:
  ///     (J - sum lambda_m H_m) d_epsilon - C^T d_lambda = Delta_Q,  C d_epsilon + dpsi/du Delta_u
  ///     = 0.
  /// False when the system is singular; the rate is NaN then.
  bool calcFormalJumpRate(const StateView& state, const double* torque_jump,
                          const double* input_jump, double* rate);

  /// lambda (k values) of the part of `reaction` in range(C^T): A lambda = C J^-1 R. Needs
  /// calcRows.
  void calcMultipliers(const double* reaction, double* lambda) const;
  /// The same, and `rest` = J^-1 (C^T lambda - R) (S values): the change of the accelerations that
  /// brings R into range(C^T). C rest = 0.
  void calcOutOfRange(const double* reaction, double* lambda, double* rest) const;

  /// Returns the residual of f, psi, or C eta + c0.
  double calcResidual(int m, const StateView& state, const double* eta) const;

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
  /// Evaluates rows and c0 by the scene's program and factors them.
  template <class Count>
  bool takeRows(Count shafts, const double* values, double* c0) {
    for (int m = 0; m < constraintCount(); ++m) {
      double* row = solver_.row(m);
      for (int i = 0; i < shafts; ++i) row[i] = values[i];
      c0[m] = values[shafts];
      values += shafts + 1;
    }
    return solver_.factor(shafts, inertia_);
  }

  /// - J' omega epsilon - n' + Gamma R omega.
  void addCovariantRate(const StateView& state, double* rate) const;

  /// Adds C_q^T Lambda to `rates` and writes psi_q, in all 3S directions; writes C into the
  /// solver's rows.
  void addRowDerivatives(const StateView& state, const double* Lambda, double* rates,
                         double (*psi_q)[kMaxRows]);
  /// The same, and Q'_q, by the scene's program of partial derivatives.
  void addPartials(const StateView& state, const double* Lambda, double* rates,
                   double (*psi_q)[kMaxRows]);
  /// P0 P v + D0 psi from SceneProgram::calcAccelerationLevel, P0 and D0 column by column. Returns
  /// false if C has lost rank.
  template <class Count>
  bool projectResidual(Count shafts, const double* level, const double* P0, const double* D0,
                       double* v, double* residual);
  /// P and D of the solver's rows, and -P J^-1 rates_q + D psi_q in all 3S directions. P is NaN
  /// where C has lost rank.
  void calcProjected(const double* rates, const double (*psi_q)[kMaxRows], SquareMatrix& projector,
                     SquareMatrix& pull, double* derivatives);

  static int countOrders(const Scene& scene, int highest);
  void note(const Dependence& dependence);
  /// Finds reads_column_: a component of C is zero everywhere if the graph says so.
  void findColumns();
  template <class Law>
  void noteBranches(const Law& law, GuardOwner owner) {
    guards_.insert(guards_.end(), law.guards().begin(), law.guards().end());
    guard_owners_.resize(guards_.size(), owner);
    instants_.insert(instants_.end(), law.instants().begin(), law.instants().end());
  }
  static int rowOf(const std::vector<int>& rows, int row) {
    return row < 0 ? -1 : rows[static_cast<std::size_t>(row)];
  }

  /// H of constraint m, s by s.
  double* hessian(int m) { return hessians_.data() + m * S * S; }
  /// (J - sum lambda_m H_m) x - C^T y = right, C x = -c0, with the rows of C in solver_ and H in
  /// hessians_. Writes x.
  bool solveFormal(const double* lambda, const double* right, const double* c0, double* x) const;

  /// |J^-1 C^T A^-1| times the rounding error of the residuals of some constraints.
  template <class Evaluate>
  void addProjectionRounding(const StateView& state, const ConstraintSolver& solver,
                             double* rounding, Evaluate evaluate) const;

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
  std::vector<CommandSignal> saved_signals_;
  std::vector<int> varying_;  // indices of the inputs that are not constant; capacity is reserved
  /// Instants that are kept, as many as an implicit step comes back to.
  static constexpr std::size_t kMoments = 8;
  std::array<double, kMoments> moment_time_ = {};
  std::vector<CommandSignal::Moment> moments_;  ///< of the inputs that vary, at each of the times
  std::size_t next_moment_ = 0;
  double input_[kMaxInputs] = {};
  double input_rate_[kMaxInputs] = {};
  double input_second_rate_[kMaxInputs] = {};
  Dependence reads_{false, false};
  std::vector<GuardPtr> guards_;
  std::vector<GuardOwner> guard_owners_;
  std::vector<double> instants_;  // s, sorted
  std::vector<double> hessians_;  // of all constraints
  mutable double torque_rate_[kMaxShafts] = {};
  bool has_constant_jacobian_ = false;
  bool reads_column_[kMaxShafts] = {};
  bool torques_read_time_ = false;
  bool keeps_constraints_in_stages_ = true;
  /// The view of calcJerkOfOneRow; its constant members are written once.
  StateView view_{0.0, nullptr, nullptr, nullptr, input_, input_rate_, input_second_rate_};
  double origin_ = 0.0;  ///< origin of times, s
  std::uint64_t right_hand_sides_ = 0;
  std::uint64_t newton_iterations_ = 0;
};

}  // namespace variator_sim
