/// One scene, evaluated: torques, inertia, constraints, inputs. What is integrated, and
/// by which principle, is the systems' matter (generalized_gauss.h, classical_gauss.h).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "central_difference.h"
#include "dense.h"
#include "state_vector.h"
#include "variator_sim/principle.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// The scene is constant; the inputs' current closed forms, the inertia at the last angle asked for
/// and the counters are the only things that change. All evaluations are [loop].
class Drivetrain {
 public:
  explicit Drivetrain(const Scene& scene)
      : S(scene.shaftCount()),
        scene_(scene),
        inertia_(scene.inertia, scene.inertia_harmonics),
        solver_(S, scene.constraintCount()),
        velocity_solver_(S, countOrders(scene, 1)),
        acceleration_solver_(S, countOrders(scene, 2)) {
    const bool rates = scene.principle == Principle::kGeneralizedGauss;
    reads_.time = false;
    reads_.angle = !inertia_.isConstant() || !scene.solver.skip_angles;
    for (const TorquePtr& torque : scene.torques) {
      torques_.push_back(torque.get());
      torques_read_time_ = torques_read_time_ || torque->torqueDependence().time;
      // Q' shows nothing of a jump of Q.
      if (!torque->guards().empty()) note(torque->torqueDependence());
      if (rates) note(torque->rateDependence());
      if (!rates || scene.hasOrder3()) note(torque->torqueDependence());
    }
    has_constant_jacobian_ = inertia_.isConstant();
    for (const ConstraintPtr& constraint : scene.constraints) {
      const int m = static_cast<int>(constraints_.size());
      constraints_.push_back(constraint.get());
      note(constraint->dependence());
      has_constant_jacobian_ = has_constant_jacobian_ && constraint->hasConstantJacobian();
      if (constraint->order() == 1) velocity_rows_.push_back(m);
      needs_second_rate_ =
          needs_second_rate_ || (constraint->order() == 1 && constraint->readsInputs());
      keeps_constraints_in_stages_ = keeps_constraints_in_stages_ && constraint->order() == 2;
      if (constraint->order() <= 2) acceleration_rows_.push_back(m);
      nonlinear_accelerations_ |= constraint->nonlinearAccelerations();
      for (const ConstraintPtr& kink : constraint->kinks()) {
        if (kinks_.size() < kMostKinks) kinks_.push_back(kink.get());
      }
    }
    for (std::size_t j = 0; j < torques_.size(); ++j) {
      noteBranches(*torques_[j], {static_cast<int>(j), -1});
    }
    for (std::size_t m = 0; m < constraints_.size(); ++m) {
      noteBranches(*constraints_[m], {-1, static_cast<int>(m)});
    }
    std::sort(instants_.begin(), instants_.end());
    has_constant_rows_ = has_constant_jacobian_ && scene.solver.factor_once;
    findColumns();
    signals_.resize(scene.inputs.size());
    saved_signals_.resize(scene.inputs.size());
    varying_.reserve(scene.inputs.size());
    resetInputs();
  }

  int shafts() const { return S; }
  const Inertia& inertia() const { return inertia_; }
  /// What a value of the state is small against, by the tolerances.
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
  unsigned nonlinearAccelerations() const { return nonlinear_accelerations_; }
  /// Where psi has kinks in epsilon: see Constraint::kinks.
  static constexpr std::size_t kMostKinks = 16;
  const std::vector<const Constraint*>& kinks() const { return kinks_; }
  bool hasOrder3() const { return static_cast<int>(acceleration_rows_.size()) < constraintCount(); }

  // --- what need not be computed (decided once, at load) ---
  /// True when a derivative of the state depends on an angle; the angles are a quadrature
  /// otherwise.
  bool readsAngles() const { return reads_.angle; }
  /// True when a derivative of the state depends on the time, be it through an input that moves.
  bool readsTime() const { return reads_.time || !varying_.empty(); }
  /// True when C and J are the same at every state: A is factored once.
  bool hasConstantRows() const { return has_constant_rows_; }
  /// True when C and J are the same at every state, whether or not that is made use of.
  bool hasConstantJacobian() const { return has_constant_jacobian_; }
  /// False when no constraint reads the highest derivative of shaft i, at some states apart.
  bool readsColumn(int i) const { return reads_column_[i]; }
  /// Begins to count right-hand sides and Newton's iterations anew.
  void resetCounts() {
    right_hand_sides_ = 0;
    newton_iterations_ = 0;
  }

  // --- inputs ----------------------------------------------------------------------------------
  void resetInputs() {
    for (std::size_t i = 0; i < signals_.size(); ++i) signals_[i].reset(scene_.inputs[i]);
    refreshInputs(0.0);
    resetCounts();
  }
  CommandSignal& signal(int input) { return signals_[input]; }
  const double* inputs() const { return input_; }
  const double* inputRates() const { return input_rate_; }
  const double* inputSecondRates() const { return input_second_rate_; }
  /// Remembers all signals, and goes back to them at `time`.
  void saveSignals() { std::copy(signals_.begin(), signals_.end(), saved_signals_.begin()); }
  void restoreSignals(double time) {
    std::copy(saved_signals_.begin(), saved_signals_.end(), signals_.begin());
    refreshInputs(time);
  }
  /// Times are counted from `by` seconds later from now on; laws are given the sum of both, what
  /// is counted from and the time.
  void moveOrigin(double by) {
    for (CommandSignal& signal : signals_) signal.moveOrigin(by);
  }
  void setOrigin(double origin) { origin_ = origin; }
  double origin() const { return origin_; }
  /// Re-evaluates every u and u' at `time` and finds out which of them vary: to be called after a
  /// signal was changed and before anything is evaluated.
  void refreshInputs(double time) {
    varying_.clear();
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      input_[i] = signals_[i].value(time);
      input_rate_[i] = signals_[i].rate(time);
      input_second_rate_[i] = signals_[i].secondRate(time);
      if (!signals_[i].isConstant()) varying_.push_back(static_cast<int>(i));
    }
  }
  /// When the first of the inputs' closed forms ends.
  double inputSegmentEnd() const {
    double end = std::numeric_limits<double>::infinity();
    for (int i : varying_) end = std::min(end, signals_[i].segmentEnd());
    return end;
  }
  /// At `time`, moves the inputs whose closed form ends until `latest` past that end.
  void finishInputSegments(double time, double latest) {
    for (int i : varying_) {
      if (signal(i).segmentEnd() <= latest) signal(i).finishSegment();
    }
    refreshInputs(time);
  }

  /// T = 1/2 omega^T J omega, J; brings J to phi.
  double calcKineticEnergy(const double* phi, const double* omega) {
    if (!inertia_.isConstant()) inertia_.update(phi);
    double momentum[kMaxShafts];
    inertia_.multiply(omega, momentum);
    double twice = 0.0;
    for (int i = 0; i < S; ++i) twice += omega[i] * momentum[i];
    return 0.5 * twice;
  }

  // --- evaluations -----------------------------------------------------------------------------
  /// u and u' at t.
  void evaluateInputs(double t) {
    if (!varying_.empty()) moveInputs(t);
  }
  [[gnu::noinline]] void moveInputs(double t) {
    for (int i : varying_) {
      input_[i] = signals_[i].value(t);
      input_rate_[i] = signals_[i].rate(t);
      if (needs_second_rate_) input_second_rate_[i] = signals_[i].secondRate(t);
    }
  }
  /// A view of (t, phi, omega, epsilon) with the inputs at t; J is brought to phi.
  StateView view(double t, const double* phi, const double* omega, const double* epsilon) {
    evaluateInputs(t);
    if (!inertia_.isConstant()) inertia_.update(phi);
    return {origin_ + t, phi, omega, epsilon, input_, input_rate_, input_second_rate_};
  }

  /// The jerk of a scene with one constraint and a simple inertia at x = (phi, omega, epsilon), the
  /// formulas of principle.h in local variables: this is where most runs spend their time, and
  /// every number that goes through the solver's memory waits there. Torques before the row, whose
  /// result is needed last. False, and nothing done, where A is not positive.
  template <int kShafts>
  bool calcJerkOfOneRow(double t, const double* x, double* eta) {
    ++right_hand_sides_;
    evaluateInputs(t);
    view_.time = origin_ + t;
    view_.angle = x;
    view_.velocity = x + kShafts;
    view_.acceleration = x + 2 * kShafts;
    double rate[kShafts];
    calcTorqueRate(std::integral_constant<int, kShafts>{}, view_, rate);
    double C[kShafts];
    double c0;
    constraints_[0]->calcRow(view_, C, &c0);
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
    solver_.noteLengthSquared(0, A);
    return true;
  }

  /// Where the components change their branches.
  const std::vector<GuardPtr>& guards() const { return guards_; }
  /// Whose guard it is: the index of a torque or of a constraint, the other one -1.
  struct GuardOwner {
    int torque;
    int constraint;
  };
  const GuardOwner& guardOwner(int guard) const {
    return guard_owners_[static_cast<std::size_t>(guard)];
  }
  /// The first instant after `time`, s, at which some law is not smooth; infinity when there is
  /// none.
  double nextInstant(double time) const {
    const auto next = std::upper_bound(instants_.begin(), instants_.end(), time);
    return next == instants_.end() ? std::numeric_limits<double>::infinity() : *next;
  }

  void countRightHandSide() { ++right_hand_sides_; }
  /// A step of Newton's iteration for the accelerations of least reaction.
  void countNewtonIteration() { ++newton_iterations_; }
  std::uint64_t newtonIterations() const { return newton_iterations_; }

  /// Applied torque Q at `state`, N m, S values.
  void calcTorque(const StateView& state, double* torque) const {
    for (int i = 0; i < S; ++i) torque[i] = 0.0;
    for (const Torque* element : torques_) element->addTorque(state, torque);
  }
  /// Its total rate Q', N m/s, S values.
  void calcTorqueRate(const StateView& state, double* torque_rate) const {
    calcTorqueRate(S, state, torque_rate);
  }
  template <class Count>
  void calcTorqueRate(Count shafts, const StateView& state, double* torque_rate) const {
    for (int i = 0; i < shafts; ++i) torque_rate[i] = 0.0;
    for (const Torque* element : torques_) element->addTorqueRate(state, torque_rate);
    for (int i = 0; i < shafts; ++i) torque_rate_[i] = torque_rate[i];
  }
  /// True when Q reads the time itself.
  bool torquesReadTime() const { return torques_read_time_; }
  /// What calcTorqueRate came to last, at the last derivative of a state, say.
  const double* torqueRate() const { return torque_rate_; }
  bool hasTorques() const { return !torques_.empty(); }

  /// Q - n, the torque that J epsilon would balance without reaction; n = 1/2 J' omega^2.
  void calcFreeTorque(const StateView& state, double* torque) const {
    calcTorque(state, torque);
    if (inertia_.isConstant()) return;
    for (int i = 0; i < S; ++i) {
      torque[i] -= 0.5 * inertia_.first(i) * state.velocity[i] * state.velocity[i];
    }
  }
  /// (Q - n - J epsilon)' + J eta = Q' - J' omega epsilon - n', with n' = 1/2 J'' omega^3 +
  /// J' omega epsilon: the rate of R is J eta minus this.
  void calcFreeTorqueRate(const StateView& state, double* rate) const {
    calcFreeTorqueRate(S, state, rate);
  }
  template <class Count>
  void calcFreeTorqueRate(Count shafts, const StateView& state, double* rate) const {
    calcTorqueRate(shafts, state, rate);
    if (inertia_.isConstant()) return;
    for (int i = 0; i < S; ++i) {
      const double w = state.velocity[i];
      rate[i] -= 2.0 * inertia_.first(i) * w * state.acceleration[i] +
                 0.5 * inertia_.second(i) * w * w * w;
    }
  }
  /// -g = Q' - J' omega epsilon - n' + Gamma R omega [6]; for constant J it is Q'.
  void calcCovariantTorqueRate(const StateView& state, double* rate) const {
    calcCovariantTorqueRate(S, state, rate);
  }
  template <class Count>
  void calcCovariantTorqueRate(Count shafts, const StateView& state, double* rate) const {
    calcFreeTorqueRate(shafts, state, rate);
    if (inertia_.isConstant()) return;
    double torque[kMaxShafts];
    double reaction[kMaxShafts];
    double connection[kMaxShafts];
    calcTorque(state, torque);
    calcReaction(state, torque, reaction);
    calcConnection(state, reaction, connection);
    for (int i = 0; i < S; ++i) rate[i] += connection[i];
  }
  /// R = J epsilon + n - Q, S values, given Q.
  void calcReaction(const StateView& state, const double* torque, double* reaction) const {
    inertia_.multiply(state.acceleration, reaction);
    for (int i = 0; i < S; ++i) reaction[i] -= torque[i];
    if (inertia_.isConstant()) return;
    for (int i = 0; i < S; ++i) {
      reaction[i] += 0.5 * inertia_.first(i) * state.velocity[i] * state.velocity[i];
    }
  }
  /// Gamma^rho_{i i} R_rho omega_i = 1/2 J_i' omega_i (J^-1 R)_i: what R' has beyond its covariant
  /// form G [6]. Only where the inertia depends on the angle.
  void calcConnection(const StateView& state, const double* reaction, double* connection) const {
    inertia_.solve(reaction, connection);
    for (int i = 0; i < S; ++i) connection[i] *= 0.5 * inertia_.first(i) * state.velocity[i];
  }

  /// Rows of C and c0 of all constraints, factored. False where C has lost rank.
  bool calcRows(const StateView& state, double* c0) { return calcRows(S, state, c0); }
  template <class Count>
  bool calcRows(Count shafts, const StateView& state, double* c0) {
    for (int m = 0; m < constraintCount(); ++m) {
      constraint(m).calcRow(state, solver_.row(m), &c0[m]);
    }
    return (has_constant_rows_ && solver_.isFactored()) || solver_.factor(shafts, inertia_);
  }

  /// Where C is constant: makes sure that it has been factored. False where it has lost rank.
  bool factorOnce(const StateView& state) {
    double c0[kMaxRows] = {};
    return constraintCount() == 0 || solver_.isFactored() || calcRows(state, c0);
  }

  /// One step of Newton's iteration onto f = 0 (orders 1) by the velocities, in the metric J:
  ///     delta omega = -J^-1 C^T A^-1 f.
  /// Writes delta (S values). False where C has lost rank.
  bool calcVelocityProjection(const StateView& state, double* delta) {
    return calcCorrection(velocity_rows_, &velocity_solver_, delta, [&](int m, double* C) {
      return constraint(m).calcVelocityResidualAndJacobian(state, C);
    });
  }
  /// The same onto psi = 0 or f' = 0 (orders 2 and 1) by the accelerations.
  bool calcAccelerationProjection(const StateView& state, double* delta) {
    return calcCorrection(acceleration_rows_, &acceleration_solver_, delta, [&](int m, double* C) {
      return constraint(m).calcResidualAndJacobian(state, C);
    });
  }
  /// True when the last one was by nearly dependent rows.
  bool areAccelerationRowsIll() const { return acceleration_solver_.isIll(); }
  /// One step of Newton's iteration onto psi = 0 by velocities and accelerations together, for
  /// scenes without constraints of order 1. Where psi changes much more with a velocity than with
  /// an acceleration (a short slip time constant tau), accelerations alone would have to make up
  /// for every rounding of the velocities, 1/tau times as large. Among all (delta omega, delta
  /// epsilon) that lead to the linearised psi = 0 this takes the least
  ///     delta_omega^T J delta_omega / h^2 + delta_epsilon^T J delta_epsilon,
  /// h the step: delta epsilon = -J^-1 C^T l, delta omega = -h^2 J^-1 B^T l, B = dpsi/domega,
  ///     (C J^-1 C^T + h^2 B J^-1 B^T) l = psi.
  /// Writes `delta`: S velocities, then S accelerations. False where the matrix is singular.
  bool calcStiffProjection(const StateView& state, double h, double* delta) {
    constexpr int kMax = kMaxRows;
    const int k = static_cast<int>(acceleration_rows_.size());
    double rows[kMax][2 * kMaxShafts];      // (B, C)
    double weighted[kMax][2 * kMaxShafts];  // (h^2 B J^-1, C J^-1)
    double scale[kMax] = {};
    DenseVector l(k);
    for (int r = 0; r < k; ++r) {
      const Constraint& constraint = *constraints_[acceleration_rows_[r]];
      ConstraintPartials partials;
      constraint.calcPartials(state, partials);
      std::copy_n(partials.velocity, S, rows[r]);
      std::copy_n(partials.acceleration, S, rows[r] + S);
      inertia_.solve(rows[r], weighted[r]);
      inertia_.solve(rows[r] + S, weighted[r] + S);
      double length = 0.0;
      for (int i = 0; i < S; ++i) weighted[r][i] *= h * h;
      for (int i = 0; i < 2 * S; ++i) length += rows[r][i] * weighted[r][i];
      // Rows of length 1 make the matrix blind to the units of psi.
      scale[r] = 1.0 / std::sqrt(length);
      l(r) = constraint.calcResidual(state) * scale[r];
    }
    if (k == 1) {
      if (!std::isfinite(scale[0])) return false;
    } else {
      DenseMatrix A(k, k);
      for (int r = 0; r < k; ++r) {
        for (int n = 0; n < k; ++n) {
          double entry = 0.0;
          for (int i = 0; i < 2 * S; ++i) entry += rows[r][i] * weighted[n][i];
          A(r, n) = entry * scale[r] * scale[n];
        }
      }
      if (!solveSymmetric(A, ConstraintSolver::kRankTolerance, &l)) return false;
    }
    for (int i = 0; i < 2 * S; ++i) {
      delta[i] = 0.0;
      for (int r = 0; r < k; ++r) delta[i] -= weighted[r][i] * scale[r] * l(r);
    }
    return true;
  }

  /// True when implicit steps may keep psi = 0 in their stages instead of C eta + c0 = 0: all
  /// constraints are of order 2.
  bool canKeepConstraintsInStages() const {
    return keeps_constraints_in_stages_ && constraintCount() > 0;
  }

  /// The motion as an implicit equation, free of the 1/tau of a stiff constraint: with D =
  /// J^-1 C^T A^-1 and the projector P = I - D C onto the jerks that C leaves free,
  ///     residual = P0 P (eta - eta_free) + D0 psi
  /// is zero where eta obeys the principle and psi = 0. P0 and D0 are P and D at the beginning of
  /// the step (S x S; S values per constraint): P and D themselves turn with C, and 1/tau or 1/h
  /// times the turn would spill the one part over into the other. False where C has lost rank.
  bool calcStageResidual(const StateView& state, const double* eta, const SquareMatrix& P0,
                         const SquareMatrix& D0, double* residual) {
    double rate[kMaxShafts];
    double v[kMaxShafts];
    calcCovariantTorqueRate(state, rate);
    inertia_.solve(rate, v);
    for (int i = 0; i < S; ++i) v[i] = eta[i] - v[i];
    return projectResidual(state, P0, D0, v, residual);
  }

  /// Its derivatives where it is zero and the multipliers are `Lambda`: by eta, P (`projector`),
  /// and by (phi, omega, epsilon), 3S directions of S values,
  ///     -P J^-1 (Q'_q + C_q^T Lambda) + D psi_q;   and D (`pull`).
  /// How J changes with the angles is left out: it is never stiff, and the derivatives steer
  /// Newton's iteration only.
  void calcStageDerivatives(const StateView& state, const double* Lambda, SquareMatrix& projector,
                            SquareMatrix& pull, double* derivatives) {
    double rates[3 * kMaxShafts * kMaxShafts] = {};
    double psi_q[3 * kMaxShafts][kMaxRows] = {};
    for (const Torque* torque : torques_) torque->addTorqueRateDerivatives(state, rates);
    addRowDerivatives(state, Lambda, rates, psi_q);
    calcProjected(rates, psi_q, projector, pull, derivatives);
  }

  /// The same one order lower, for the classical principle with constraints linear in epsilon: the
  /// stages' unknown is epsilon itself,
  ///     residual = P0 P (epsilon - epsilon_free) + D0 psi(t, phi, omega, epsilon),
  /// free of the 1/tau that epsilon(t, phi, omega) has in it.
  bool calcAccelerationResidual(const StateView& state, const SquareMatrix& P0,
                                const SquareMatrix& D0, double* residual) {
    double torque[kMaxShafts];
    double v[kMaxShafts];
    calcFreeTorque(state, torque);
    inertia_.solve(torque, v);
    for (int i = 0; i < S; ++i) v[i] = state.acceleration[i] - v[i];
    return projectResidual(state, P0, D0, v, residual);
  }
  /// Its derivatives by (phi, omega), 2S directions of S values, where it is zero and the
  /// multipliers are `lambda`: -P J^-1 (Q_q + C_q^T lambda) + D psi_q. That by epsilon is
  /// P + D C = I.
  void calcAccelerationDerivatives(const StateView& state, const double* lambda,
                                   SquareMatrix& projector, SquareMatrix& pull,
                                   double* derivatives) {
    const int directions = 2 * S;
    double torques[3 * kMaxShafts * kMaxShafts] = {};
    double psi_q[3 * kMaxShafts][kMaxRows] = {};
    const auto differentiate = [&](int q, const StateView& above, const StateView& below,
                                   double width) {
      if (q >= directions) return;
      double upper[kMaxShafts];
      double lower[kMaxShafts];
      calcTorque(above, upper);
      calcTorque(below, lower);
      for (int i = 0; i < S; ++i) torques[q * S + i] = (upper[i] - lower[i]) / width;
    };
    forEachShift(state, S, differentiate, naturalSize());
    addRowDerivatives(state, lambda, torques, psi_q);
    double all[3 * kMaxShafts * kMaxShafts];
    calcProjected(torques, psi_q, projector, pull, all);
    std::copy_n(all, directions * S, derivatives);
  }

  /// d eta/d(phi, omega, epsilon) at `state`, where the jerk is `eta` and the multipliers `Lambda`,
  /// for a constant inertia: 3S directions of S values each. Differentiating
  ///     J eta - C^T Lambda = Q',   C eta = -c0
  /// in direction q gives the same system with other right sides,
  ///     J eta_q - C^T Lambda_q = Q'_q + C_q^T Lambda,   C eta_q = -(c0_q + C_q eta).
  /// Needs calcRows at `state`.
  void calcJerkDerivatives(const StateView& state, const double* eta, const double* Lambda,
                           double* derivatives) const {
    const int directions = 3 * S;
    std::fill_n(derivatives, directions * S, 0.0);
    for (const Torque* torque : torques_) torque->addTorqueRateDerivatives(state, derivatives);
    double right[3 * kMaxShafts][kMaxRows] = {};
    for (int m = 0; m < constraintCount(); ++m) {
      double dC[3 * kMaxShafts * kMaxShafts];
      double dc0[3 * kMaxShafts];
      constraint(m).calcRowDerivatives(state, dC, dc0);
      for (int q = 0; q < directions; ++q) {
        double sum = dc0[q];
        for (int i = 0; i < S; ++i) {
          sum += dC[q * S + i] * eta[i];
          derivatives[q * S + i] += dC[q * S + i] * Lambda[m];
        }
        right[q][m] = sum;
      }
    }
    for (int q = 0; q < directions; ++q) {
      double rate[kMaxShafts];
      std::copy_n(derivatives + q * S, S, rate);
      double* eta_q = derivatives + q * S;
      inertia_.solve(rate, eta_q);
      double Lambda_q[kMaxRows] = {};
      if (constraintCount() > 0) solver_.constrain(right[q], eta_q, Lambda_q);
    }
  }

  /// The least-reaction accelerations of the second-order forms linearised at `state`:
  ///     free - J^-1 C^T A^-1 (psi + C (free - epsilon)),
  /// as the correction to `free` (S values each). False where C has lost rank.
  bool calcLinearizedReaction(const StateView& state, const double* free, double* delta) {
    return calcCorrection(acceleration_rows_, &acceleration_solver_, delta, [&](int m, double* C) {
      double residual = constraint(m).calcResidualAndJacobian(state, C);
      for (int i = 0; i < S; ++i) residual += C[i] * (free[i] - state.acceleration[i]);
      return residual;
    });
  }
  /// Squared length of row r of accelerationRows() in the last acceleration projection.
  double accelerationRowLengthSquared(int r) const {
    return acceleration_solver_.rowLengthSquared(r);
  }
  const double* accelerationRow(int r) const { return acceleration_solver_.row(r); }
  /// What rounding of time, angles, velocities and accelerations at `state` makes of a projection
  /// onto the constraints: of each velocity and each acceleration (S values each). Residuals are
  /// evaluated beside the state, some roundings off in each of its parts. Needs the last
  /// projection's rows. Not cheap; for steps that seem too long.
  void calcProjectionRounding(const StateView& state, double* velocity, double* acceleration) {
    std::fill_n(velocity, S, 0.0);
    std::fill_n(acceleration, S, 0.0);
    addProjectionRounding(
        state, velocity_rows_, velocity_solver_, velocity,
        [&](int m, const StateView& at) { return constraint(m).calcResidual(at); });
    addProjectionRounding(state, acceleration_rows_, acceleration_solver_, acceleration,
                          [&](int m, const StateView& at) {
                            double C[kMaxShafts];
                            return constraint(m).calcResidualAndJacobian(at, C);
                          });
  }
  /// The constraint at which the last projection lost rank.
  int singularVelocityConstraint() const {
    return rowOf(velocity_rows_, velocity_solver_.singularRow());
  }
  int singularAccelerationConstraint() const {
    return rowOf(acceleration_rows_, acceleration_solver_.singularRow());
  }

  /// d epsilon / d theta of the jump map at `state`, whose inputs stand at theta:
  ///     C d_epsilon + dpsi/du Delta_u = 0,   J d_epsilon = Delta_Q + C^T Lambda.
  /// False where C has lost rank; the rate is NaN then.
  bool calcJumpRate(const StateView& state, const double* torque_jump, const double* input_jump,
                    double* rate) {
    inertia_.solve(torque_jump, rate);
    if (constraintCount() == 0) return true;
    double c0[kMaxRows] = {};
    for (int m = 0; m < constraintCount(); ++m) {
      double unused;
      const Constraint& row = constraint(m);
      if (row.order() == 3) {
        row.calcRow(state, solver_.row(m), &unused);
      } else {
        row.calcResidualAndJacobian(state, solver_.row(m));
      }
      c0[m] = 0.0;
      if (row.readsInputs()) {
        double Cu[kMaxInputs];
        row.calcInputJacobian(state, inputCount(), Cu);
        for (int i = 0; i < inputCount(); ++i) c0[m] += Cu[i] * input_jump[i];
      }
    }
    if (!solver_.factor(inertia_)) {
      for (int i = 0; i < S; ++i) rate[i] = std::numeric_limits<double>::quiet_NaN();
      return false;
    }
    double Lambda[kMaxRows] = {};
    solver_.constrain(c0, rate, Lambda);
    return true;
  }

  /// What a kink of constraints of order 1 does to the accelerations: f' is f0'(e) = C0 e + b0
  /// `before` it and f1'(e) = C1 e + b1 `after`. A smooth f would go from the one to the other
  /// within next to no time, with every weight theta between 0 and 1 on the second, and its large
  /// f'' would meet a large Lambda, while psi of order 2 stays 0 and order 3 keeps its C:
  ///     C(theta, e) = (1 - theta) C0(e) + theta C1(e),   J de/dtheta = C^T Lambda,
  ///     C de/dtheta + f1'(e) - f0'(e) = 0.
  /// Writes the change of epsilon (S values). False where C loses rank.
  bool calcKinkJump(StateView before, StateView after, double* change) {
    const double* begin = after.acceleration;
    const int k = constraintCount();
    const auto slope = [&](double theta, const double* moved, double* rate) {
      double e[kMaxShafts];
      double C[kMaxShafts];
      double gap[kMaxRows] = {};
      for (int i = 0; i < S; ++i) e[i] = begin[i] + moved[i];
      before.acceleration = after.acceleration = e;
      for (int m = 0; m < k; ++m) {
        const Constraint& row = constraint(m);
        double* mean = solver_.row(m);
        double unused = 0.0;
        if (row.order() == 3) {
          row.calcRow(before, C, &unused);
          row.calcRow(after, mean, &unused);
        } else {
          gap[m] = -row.calcResidualAndJacobian(before, C);
          gap[m] += row.calcResidualAndJacobian(after, mean);
        }
        for (int i = 0; i < S; ++i) mean[i] = (1.0 - theta) * C[i] + theta * mean[i];
      }
      double Lambda[kMaxRows] = {};
      std::fill_n(rate, S, 0.0);
      if (!solver_.factor(inertia_)) return false;
      solver_.constrain(gap, rate, Lambda);
      return true;
    };
    // Of the classical Runge-Kutta method, for nothing here is stiff; where C does not turn one
    // step is exact.
    constexpr int kSteps = 200;
    constexpr double kTurned = 1e-12;
    double k1[kMaxShafts];
    double k2[kMaxShafts];
    double k3[kMaxShafts];
    double k4[kMaxShafts];
    double e[kMaxShafts];
    std::fill_n(change, S, 0.0);
    if (!slope(0.0, change, k1) || !slope(1.0, k1, k4)) return false;
    double largest = 0.0;
    double turn = 0.0;
    for (int i = 0; i < S; ++i) {
      largest = std::max(largest, std::abs(k1[i]));
      turn = std::max(turn, std::abs(k4[i] - k1[i]));
    }
    const int steps = turn > kTurned * largest ? kSteps : 1;
    const double h = 1.0 / steps;
    for (int n = 0; n < steps; ++n) {
      const double theta = n * h;
      if (!slope(theta, change, k1)) return false;
      for (int i = 0; i < S; ++i) e[i] = change[i] + 0.5 * h * k1[i];
      if (!slope(theta + 0.5 * h, e, k2)) return false;
      for (int i = 0; i < S; ++i) e[i] = change[i] + 0.5 * h * k2[i];
      if (!slope(theta + 0.5 * h, e, k3)) return false;
      for (int i = 0; i < S; ++i) e[i] = change[i] + h * k3[i];
      if (!slope(theta + h, e, k4)) return false;
      for (int i = 0; i < S; ++i) change[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
    return true;
  }

  /// The jerk that keeps R = C^T lambda, i.e. the derivative of J epsilon + n - Q = C^T lambda:
  ///     (J - sum lambda_m H_m) eta - C^T lambda' = free torque rate + sum lambda_m D_m,
  ///     C eta + c0 = 0,   dC/dt = D + H eta        [17, 18].
  /// `lambda` (k values) is given; eta and the reaction rate R' = J eta - free torque rate are
  /// written (S values each). False when the system is singular.
  bool calcFormalJerk(const StateView& state, const double* lambda, double* eta,
                      double* reaction_rate) {
    double rate[kMaxShafts];
    calcFreeTorqueRate(state, rate);
    double right[kMaxShafts];
    double c0[kMaxRows] = {};
    double H[kMaxRows * kMaxShafts * kMaxShafts];
    std::copy(rate, rate + S, right);
    for (int m = 0; m < constraintCount(); ++m) {
      double D[kMaxShafts];
      constraint(m).calcRow(state, solver_.row(m), &c0[m]);
      constraint(m).calcJacobianRate(state, D, H + m * S * S);
      for (int i = 0; i < S; ++i) right[i] += lambda[m] * D[i];
    }
    if (!solveFormal(lambda, H, right, c0, eta)) return false;
    inertia_.multiply(eta, reaction_rate);
    for (int i = 0; i < S; ++i) reaction_rate[i] -= rate[i];
    return true;
  }

  /// d epsilon / d theta of a jump along which R stays C^T lambda:
  ///     (J - sum lambda_m H_m) d_epsilon - C^T d_lambda = Delta_Q,  C d_epsilon + dpsi/du Delta_u
  ///     = 0.
  /// False when the system is singular; the rate is NaN then.
  bool calcFormalJumpRate(const StateView& state, const double* torque_jump,
                          const double* input_jump, double* rate) {
    if (!calcJumpRate(state, torque_jump, input_jump, rate)) return false;
    double torque[kMaxShafts];
    double reaction[kMaxShafts];
    double lambda[kMaxRows] = {};
    double H[kMaxRows * kMaxShafts * kMaxShafts];
    double c0[kMaxRows] = {};
    calcTorque(state, torque);
    calcReaction(state, torque, reaction);
    calcMultipliers(reaction, lambda);
    for (int m = 0; m < constraintCount(); ++m) {
      constraint(m).calcHessian(state, H + m * S * S);
      // calcJumpRate has just made C d_epsilon = -dpsi/du Delta_u.
      for (int i = 0; i < S; ++i) c0[m] -= solver_.row(m)[i] * rate[i];
    }
    if (solveFormal(lambda, H, torque_jump, c0, rate)) return true;
    for (int i = 0; i < S; ++i) rate[i] = std::numeric_limits<double>::quiet_NaN();
    return false;
  }

  /// lambda (k values) of the part of `reaction` in range(C^T): A lambda = C J^-1 R. Needs
  /// calcRows.
  void calcMultipliers(const double* reaction, double* lambda) const {
    double rest[kMaxShafts];
    calcOutOfRange(reaction, lambda, rest);
  }
  /// The same, and `rest` = J^-1 (C^T lambda - R) (S values): by so much do accelerations change
  /// for R to lie in range(C^T). C rest = 0.
  void calcOutOfRange(const double* reaction, double* lambda, double* rest) const {
    constexpr double kZeros[kMaxRows] = {};
    inertia_.solve(reaction, rest);
    for (int i = 0; i < S; ++i) rest[i] = -rest[i];
    solver_.constrain(kZeros, rest, lambda);
  }

  /// What is left of f, psi, or C eta + c0.
  double calcResidual(int m, const StateView& state, const double* eta) const {
    const Constraint& row = constraint(m);
    if (row.order() < 3) return row.calcResidual(state);
    double C[kMaxShafts];
    double c0;
    row.calcRow(state, C, &c0);
    for (int i = 0; i < S; ++i) c0 += C[i] * eta[i];
    return c0;
  }

  /// Which component gives a value that is not finite at `state` (first torques, then constraints),
  /// for messages. Returns false when all are finite.
  bool findNonFinite(const StateView& state, int* torque, int* row) const {
    *torque = -1;
    *row = -1;
    for (std::size_t j = 0; j < torques_.size(); ++j) {
      double value[kMaxShafts] = {};
      double rate[kMaxShafts] = {};
      torques_[j]->addTorque(state, value);
      torques_[j]->addTorqueRate(state, rate);
      for (int i = 0; i < S; ++i) {
        if (!std::isfinite(value[i]) || !std::isfinite(rate[i])) {
          *torque = static_cast<int>(j);
          return true;
        }
      }
    }
    for (int m = 0; m < constraintCount(); ++m) {
      double C[kMaxShafts];
      double c0;
      constraint(m).calcRow(state, C, &c0);
      bool finite = std::isfinite(c0) && (constraint(m).order() == 3 ||
                                          std::isfinite(constraint(m).calcResidual(state)));
      for (int i = 0; i < S; ++i) finite = finite && std::isfinite(C[i]);
      if (!finite) {
        *row = m;
        return true;
      }
    }
    return false;
  }

 private:
  /// C_q^T Lambda onto `rates` and psi_q, in all 3S directions; C into the solver's rows.
  void addRowDerivatives(const StateView& state, const double* Lambda, double* rates,
                         double (*psi_q)[kMaxRows]) {
    const int directions = 3 * S;
    for (int m = 0; m < constraintCount(); ++m) {
      double dC[3 * kMaxShafts * kMaxShafts];
      double dc0[3 * kMaxShafts];
      ConstraintPartials partials;
      constraint(m).calcRowDerivatives(state, dC, dc0);
      constraint(m).calcPartials(state, partials);
      for (int j = 0; j < S; ++j) {
        psi_q[j][m] = partials.angle[j];
        psi_q[S + j][m] = partials.velocity[j];
        psi_q[2 * S + j][m] = partials.acceleration[j];
        solver_.row(m)[j] = partials.acceleration[j];
      }
      for (int n = 0; n < directions * S; ++n) rates[n] += dC[n] * Lambda[m];
    }
  }
  /// P0 P v + D0 psi at `state`. False where C has lost rank.
  bool projectResidual(const StateView& state, const SquareMatrix& P0, const SquareMatrix& D0,
                       double* v, double* residual) {
    double psi[kMaxRows] = {};
    const double zeros[kMaxRows] = {};
    for (int m = 0; m < constraintCount(); ++m) {
      psi[m] = constraint(m).calcResidualAndJacobian(state, solver_.row(m));
    }
    if (!solver_.factor(inertia_)) return false;
    double l[kMaxRows] = {};
    solver_.constrain(zeros, v, l);
    for (int i = 0; i < S; ++i) {
      residual[i] = 0.0;
      for (int j = 0; j < S; ++j) residual[i] += P0(i, j) * v[j];
      for (int m = 0; m < constraintCount(); ++m) residual[i] += D0(i, m) * psi[m];
    }
    return true;
  }
  /// P and D of the solver's rows, and -P J^-1 rates_q + D psi_q in all 3S directions. P is NaN
  /// where C has lost rank.
  void calcProjected(const double* rates, const double (*psi_q)[kMaxRows], SquareMatrix& projector,
                     SquareMatrix& pull, double* derivatives) {
    const int directions = 3 * S;
    if (!solver_.factor(inertia_)) {
      projector.fill(std::numeric_limits<double>::quiet_NaN());
      return;
    }
    // x + D (y - C x), the part of x that C leaves free and D y
    const auto combine = [&](double* x, const double* y) {
      double l[kMaxRows] = {};
      solver_.multiply(x, l);
      for (int m = 0; m < constraintCount(); ++m) l[m] = y[m] - l[m];
      solver_.solve(l, l);
      solver_.addReaction(l, x);
    };
    const double zeros[kMaxRows] = {};
    for (int j = 0; j < S; ++j) {
      double column[kMaxShafts] = {};
      column[j] = 1.0;
      combine(column, zeros);
      for (int i = 0; i < S; ++i) projector(i, j) = column[i];
    }
    for (int m = 0; m < constraintCount(); ++m) {
      double column[kMaxShafts] = {};
      double unit[kMaxRows] = {};
      unit[m] = 1.0;
      combine(column, unit);
      for (int i = 0; i < S; ++i) pull(i, m) = column[i];
    }
    for (int q = 0; q < directions; ++q) {
      double* column = derivatives + q * S;
      inertia_.solve(rates + q * S, column);
      for (int i = 0; i < S; ++i) column[i] = -column[i];
      combine(column, psi_q[q]);
    }
  }

  static int countOrders(const Scene& scene, int highest) {
    int count = 0;
    for (const ConstraintPtr& constraint : scene.constraints) {
      if (constraint->order() <= highest) ++count;
    }
    return count;
  }
  void note(const Dependence& dependence) {
    reads_.time = reads_.time || dependence.time;
    reads_.angle = reads_.angle || dependence.angle;
  }
  /// reads_column_: a component of C that is zero at several states that have nothing in common is
  /// zero everywhere.
  void findColumns() {
    constexpr int kStates = 6;
    double number = 0.5;
    const auto next = [&number] {  // the golden ratio's multiples modulo 1: evenly spread
      number += 0.6180339887498949;
      number -= std::floor(number);
      return 0.1 + 3.0 * number;
    };
    for (int n = 0; n < kStates; ++n) {
      double x[3][kMaxShafts];
      double input[3][kMaxInputs];
      for (auto& part : x) {
        for (double& value : part) value = (n % 2 == 0 ? 1.0 : -1.0) * next();
      }
      for (auto& part : input) {
        for (double& value : part) value = next();
      }
      const StateView state{next(), x[0], x[1], x[2], input[0], input[1], input[2]};
      if (!inertia_.isConstant()) inertia_.update(x[0]);
      for (const Constraint* row : constraints_) {
        double C[kMaxShafts];
        double c0;
        row->calcRow(state, C, &c0);
        for (int i = 0; i < S; ++i) reads_column_[i] = reads_column_[i] || C[i] != 0.0;
      }
    }
  }
  template <class Law>
  void noteBranches(const Law& law, GuardOwner owner) {
    for (GuardPtr& guard : law.guards()) {
      guards_.push_back(std::move(guard));
      guard_owners_.push_back(owner);
    }
    const std::vector<double> instants = law.instants();
    instants_.insert(instants_.end(), instants.begin(), instants.end());
  }
  static int rowOf(const std::vector<int>& rows, int row) {
    return row < 0 ? -1 : rows[static_cast<std::size_t>(row)];
  }

  /// (J - sum lambda_m H_m) x - C^T y = right, C x = -c0, with the rows of C in solver_. Writes x.
  bool solveFormal(const double* lambda, const double* H, const double* right, const double* c0,
                   double* x) const {
    const int k = constraintCount();
    DenseMatrix K = DenseMatrix::Zero(S + k, S + k);
    DenseVector b = DenseVector::Zero(S + k);
    for (int i = 0; i < S; ++i) {
      b(i) = right[i];
      for (int j = 0; j < S; ++j) K(i, j) = inertia_.entry(i, j);
    }
    for (int m = 0; m < k; ++m) {
      b(S + m) = -c0[m];
      for (int i = 0; i < S; ++i) {
        K(S + m, i) = solver_.row(m)[i];
        K(i, S + m) = -solver_.row(m)[i];
        for (int j = 0; j < S; ++j) K(i, j) -= lambda[m] * H[(m * S + i) * S + j];
      }
    }
    // y is as large as rows of C are near to each other, and what rounding of the factors makes of
    // the zeros in K meets it: that is given back by solving for what is left.
    constexpr int kRefinements = 2;
    DenseVector solution;
    if (!solveScaled(K, b, kRefinements, &solution)) return false;
    for (int i = 0; i < S; ++i) x[i] = solution(i);
    return true;
  }

  /// |J^-1 C^T A^-1| times what rounding makes of the residuals of some constraints.
  template <class Evaluate>
  void addProjectionRounding(const StateView& state, const std::vector<int>& rows,
                             const ConstraintSolver& solver, double* rounding,
                             Evaluate evaluate) const {
    constexpr double kUlps = 8.0 * std::numeric_limits<double>::epsilon();
    for (int r = 0; r < solver.rowCount(); ++r) {
      const int m = rows[static_cast<std::size_t>(r)];
      const double here = evaluate(m, state);
      double noise = kUlps * std::abs(here);
      StateView beside = state;
      beside.time = state.time * (1.0 + kUlps);
      noise += std::abs(evaluate(m, beside) - here);
      // sin(t + 1e8) knows its argument to 1e-8: how far is it from smooth?
      double bend = 0.0;
      for (const double part : {1e-7, 6.18e-8, 3.82e-8, 2.36e-8}) {
        beside.time = state.time + part;
        double sum = evaluate(m, beside);
        beside.time = state.time - part;
        sum += evaluate(m, beside);
        bend = std::max(bend, std::abs(sum - 2.0 * here));
      }
      noise += 2.0 * bend;
      beside.time = state.time;
      double shifted[kMaxShafts];
      for (const double* StateView::*part :
           {&StateView::angle, &StateView::velocity, &StateView::acceleration}) {
        std::copy_n(state.*part, S, shifted);
        beside.*part = shifted;
        for (int i = 0; i < S; ++i) {
          shifted[i] = (state.*part)[i] * (1.0 + kUlps);
          noise += std::abs(evaluate(m, beside) - here);
          shifted[i] = (state.*part)[i];
        }
        beside.*part = state.*part;
      }
      double l[kMaxRows] = {};
      double moved[kMaxShafts] = {};
      l[r] = noise;
      solver.solve(l, l);
      solver.addReaction(l, moved);
      for (int i = 0; i < S; ++i) rounding[i] += std::abs(moved[i]);
    }
  }

  /// -J^-1 C^T A^-1 residual over some constraints; `evaluate(m, C)` gives residual and row.
  template <class Evaluate>
  bool calcCorrection(const std::vector<int>& rows, ConstraintSolver* solver, double* delta,
                      Evaluate evaluate) {
    double residual[kMaxRows] = {};
    for (int r = 0; r < solver->rowCount(); ++r) residual[r] = evaluate(rows[r], solver->row(r));
    if (!solver->isFactored() || !has_constant_rows_) {
      if (!solver->factor(inertia_)) return false;
    }
    for (int r = 0; r < solver->rowCount(); ++r) residual[r] = -residual[r];
    solver->solve(residual, residual);
    for (int i = 0; i < S; ++i) delta[i] = 0.0;
    solver->addReaction(residual, delta);
    return true;
  }

  const int S;  // shafts
  const Scene& scene_;
  Inertia inertia_;
  ConstraintSolver solver_;               // all constraints
  ConstraintSolver velocity_solver_;      // those of order 1
  ConstraintSolver acceleration_solver_;  // those of order 1 and 2
  std::vector<const Torque*> torques_;
  std::vector<const Constraint*> constraints_;
  std::vector<const Constraint*> kinks_;
  unsigned nonlinear_accelerations_ = 0;
  std::vector<int> velocity_rows_;
  std::vector<int> acceleration_rows_;
  std::vector<CommandSignal> signals_;
  std::vector<CommandSignal> saved_signals_;
  std::vector<int> varying_;  // indices of the inputs that are not constant; capacity is reserved
  double input_[kMaxInputs] = {};
  double input_rate_[kMaxInputs] = {};
  double input_second_rate_[kMaxInputs] = {};
  Dependence reads_{false, false};
  std::vector<GuardPtr> guards_;
  std::vector<GuardOwner> guard_owners_;
  std::vector<double> instants_;  // s, sorted
  mutable double torque_rate_[kMaxShafts] = {};
  bool has_constant_rows_ = false;
  bool has_constant_jacobian_ = false;
  bool reads_column_[kMaxShafts] = {};
  bool torques_read_time_ = false;
  bool keeps_constraints_in_stages_ = true;
  /// Of calcJerkOfOneRow: what never changes of it is written once.
  StateView view_{0.0, nullptr, nullptr, nullptr, input_, input_rate_, input_second_rate_};
  bool needs_second_rate_ = false;  ///< some constraint of order 1 reads an input
  double origin_ = 0.0;             ///< from which times are counted, s
  std::uint64_t right_hand_sides_ = 0;
  std::uint64_t newton_iterations_ = 0;
};

}  // namespace variator_sim
