/// The drivetrain as a system of ordinary differential equations: x = (phi, omega, epsilon),
/// x' = (omega, epsilon, eta), with eta from the principle.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "variator_sim/principle.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Evaluates one scene of S shafts. The scene is constant; the inputs' current closed forms and the
/// counters are the only things that change. All evaluations are [loop].
template <int S>
class Drivetrain {
 public:
  static constexpr int kShafts = S;
  static constexpr int kMaxRows = ConstraintSolver<S>::kMaxRows;
  /// (phi, omega, epsilon), S values each.
  using State = std::array<double, 3 * S>;

  explicit Drivetrain(const Scene& scene)
      : scene_(scene), inertia_(scene.inertia), solver_(scene.constraintCount()) {
    for (const TorquePtr& torque : scene.torques) torques_.push_back(torque.get());
    for (const ConstraintPtr& constraint : scene.constraints) {
      constraints_.push_back(constraint.get());
    }
    signals_.resize(scene.inputs.size());
    saved_signals_.resize(scene.inputs.size());
    varying_.reserve(scene.inputs.size());
    resetInputs();
  }

  const Inertia<S>& inertia() const { return inertia_; }
  int constraintCount() const { return solver_.rowCount(); }
  int inputCount() const { return static_cast<int>(signals_.size()); }
  const Constraint& constraint(int m) const { return *constraints_[m]; }
  const ConstraintSolver<S>& solver() const { return solver_; }
  std::uint64_t rightHandSides() const { return right_hand_sides_; }

  // --- inputs ----------------------------------------------------------------------------------
  void resetInputs() {
    for (std::size_t i = 0; i < signals_.size(); ++i) signals_[i].reset(scene_.inputs[i]);
    refreshInputs(0.0);
    right_hand_sides_ = 0;
  }
  CommandSignal& signal(int input) { return signals_[input]; }
  const double* inputs() const { return input_; }
  /// Remembers all signals, and goes back to them at `time`.
  void saveSignals() { std::copy(signals_.begin(), signals_.end(), saved_signals_.begin()); }
  void restoreSignals(double time) {
    std::copy(saved_signals_.begin(), saved_signals_.end(), signals_.begin());
    refreshInputs(time);
  }
  /// Re-evaluates every u and u' at `time` and finds out which of them vary: to be called after a
  /// signal was changed and before anything is evaluated.
  void refreshInputs(double time) {
    varying_.clear();
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      input_[i] = signals_[i].value(time);
      input_rate_[i] = signals_[i].rate(time);
      if (!signals_[i].isConstant()) varying_.push_back(static_cast<int>(i));
    }
  }
  /// When the first of the inputs' closed forms ends.
  double inputSegmentEnd() const {
    double end = std::numeric_limits<double>::infinity();
    for (int i : varying_) end = std::min(end, signals_[i].segmentEnd());
    return end;
  }
  /// Moves the inputs whose closed form ends at `time` past it.
  void finishInputSegments(double time) {
    for (int i : varying_) {
      if (signal(i).segmentEnd() <= time) signal(i).finishSegment();
    }
    refreshInputs(time);
  }

  // --- evaluations -----------------------------------------------------------------------------
  /// The view at (t, x) with the inputs at t.
  StateView view(double t, const double* x) {
    for (int i : varying_) {
      input_[i] = signals_[i].value(t);
      input_rate_[i] = signals_[i].rate(t);
    }
    return {t, x, x + S, x + 2 * S, input_, input_rate_};
  }

  /// eta at `state` and Lambda (kMaxRows values). False where C has lost rank; eta is NaN then.
  bool calcJerk(const StateView& state, double* eta, double* Lambda) {
    ++right_hand_sides_;
    // Q' (total rate), then eta_free = J^-1 Q'
    double torque_rate[S] = {};
    for (const Torque* torque : torques_) torque->addTorqueRate(state, torque_rate);
    inertia_.solve(torque_rate, eta);
    if (constraintCount() == 0) return true;
    // C eta + c0 = 0 [12]
    double c0[kMaxRows];
    for (int m = 0; m < constraintCount(); ++m) {
      constraint(m).calcRow(state, solver_.row(m), &c0[m]);
    }
    if (!solver_.factor(inertia_)) {
      for (int i = 0; i < S; ++i) eta[i] = std::numeric_limits<double>::quiet_NaN();
      return false;
    }
    solver_.constrain(c0, eta, Lambda);
    return true;
  }

  /// x' at (t, x): the system as Boost.Odeint calls it.
  void operator()(const State& x, State& dxdt, double t) {
    for (int i = 0; i < 2 * S; ++i) dxdt[i] = x[S + i];
    double Lambda[kMaxRows];
    calcJerk(view(t, x.data()), &dxdt[2 * S], Lambda);
  }

  /// Applied torque Q at `state`, N m, S values.
  void calcTorque(const StateView& state, double* torque) const {
    for (int i = 0; i < S; ++i) torque[i] = 0.0;
    for (const Torque* element : torques_) element->addTorque(state, torque);
  }

  /// Everything that is published, at (t, x). False where C has lost rank.
  bool calcSample(double t, const State& x, Sample* sample) {
    const StateView state = view(t, x.data());
    sample->time = t;
    for (int i = 0; i < S; ++i) {
      sample->angle[i] = x[i];
      sample->velocity[i] = x[S + i];
      sample->acceleration[i] = x[2 * S + i];
    }
    // R = J epsilon - Q
    calcTorque(state, sample->applied_torque);
    inertia_.multiply(state.acceleration, sample->reaction_torque);
    for (int i = 0; i < S; ++i) sample->reaction_torque[i] -= sample->applied_torque[i];
    // R' = C^T Lambda
    double eta[S];
    const bool regular = calcJerk(state, eta, sample->multiplier);
    for (int i = 0; i < S; ++i) sample->reaction_torque_rate[i] = 0.0;
    for (int m = 0; m < constraintCount(); ++m) {
      const double* C = solver_.row(m);
      for (int i = 0; i < S; ++i) sample->reaction_torque_rate[i] += C[i] * sample->multiplier[m];
      sample->residual[m] = constraint(m).calcResidual(state);
    }
    return regular;
  }

  /// One step of Newton's iteration onto psi = 0 in the metric J:
  ///     delta epsilon = -J^-1 C^T A^-1 psi.
  /// Writes delta (S values). False where C has lost rank.
  bool calcProjection(const StateView& state, double* delta) {
    double psi[kMaxRows];
    for (int m = 0; m < constraintCount(); ++m) {
      psi[m] = constraint(m).calcResidualAndJacobian(state, solver_.row(m));
    }
    if (!solver_.factor(inertia_)) return false;
    for (int m = 0; m < constraintCount(); ++m) psi[m] = -psi[m];
    solver_.solve(psi, psi);
    for (int i = 0; i < S; ++i) delta[i] = 0.0;
    solver_.addReaction(psi, delta);
    return true;
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
      constraint(m).calcResidualAndJacobian(state, solver_.row(m));
      c0[m] = 0.0;
      if (constraint(m).readsInputs()) {
        double Cu[kMaxInputs];
        constraint(m).calcInputJacobian(state, inputCount(), Cu);
        for (int i = 0; i < inputCount(); ++i) c0[m] += Cu[i] * input_jump[i];
      }
    }
    if (!solver_.factor(inertia_)) {
      for (int i = 0; i < S; ++i) rate[i] = std::numeric_limits<double>::quiet_NaN();
      return false;
    }
    double Lambda[kMaxRows];
    solver_.constrain(c0, rate, Lambda);
    return true;
  }

  /// Which component gives a value that is not finite at `state` (first torques, then constraints),
  /// for messages. Returns false when all are finite.
  bool findNonFinite(const StateView& state, int* torque, int* row) const {
    *torque = -1;
    *row = -1;
    for (std::size_t j = 0; j < torques_.size(); ++j) {
      double value[S] = {};
      double rate[S] = {};
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
      double C[S];
      double c0;
      constraint(m).calcRow(state, C, &c0);
      bool finite = std::isfinite(c0) && std::isfinite(constraint(m).calcResidual(state));
      for (int i = 0; i < S; ++i) finite = finite && std::isfinite(C[i]);
      if (!finite) {
        *row = m;
        return true;
      }
    }
    return false;
  }

 private:
  const Scene& scene_;
  Inertia<S> inertia_;
  ConstraintSolver<S> solver_;
  std::vector<const Torque*> torques_;
  std::vector<const Constraint*> constraints_;
  std::vector<CommandSignal> signals_;
  std::vector<CommandSignal> saved_signals_;
  std::vector<int> varying_;  // indices of the inputs that are not constant; capacity is reserved
  double input_[kMaxInputs] = {};
  double input_rate_[kMaxInputs] = {};
  std::uint64_t right_hand_sides_ = 0;
};

}  // namespace variator_sim
