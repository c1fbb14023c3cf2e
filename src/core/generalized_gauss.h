/// The system of the generalized Gauss principle: x = (phi, omega, epsilon), x' = (omega, epsilon,
/// eta) with the jerk whose reaction changes least.
#pragma once

#include "acceleration_system.h"

namespace variator_sim {

/// See AccelerationSystem for what it has beside its derivative and its sample.
template <class Shape>
class GeneralizedGauss : public AccelerationSystem<Shape> {
  using Base = AccelerationSystem<Shape>;
  using Base::drivetrain_;
  using Base::S;

 public:
  using typename Base::State;

  explicit GeneralizedGauss(const Scene& scene) : Base(scene, false) {}

  /// x' at (t, x): the system as Boost.Odeint calls it. NaN where C has lost rank.
  [[gnu::noinline]] void operator()(const State& x, State& dxdt, double t) {
    this->copyRates(x, dxdt);
    if constexpr (Shape::kRows == 1 && Shape::InertiaType::kSimple) {
      if (drivetrain_.calcJerkOfOneRow(t, x.data(), &dxdt[2 * S])) return;
    }
    double Lambda[Drivetrain<Shape>::kMaxRows] = {};
    calcJerk(this->view(t, x), &dxdt[2 * S], Lambda);
  }

  /// eta and Lambda. False, and eta NaN, where C has lost rank.
  bool calcJerk(const StateView& state, double* eta, double* Lambda) {
    drivetrain_.countRightHandSide();
    // Rows first: what takes longest (a sine, the pivot's reciprocal) is under way when the torques
    // are asked.
    double c0[Drivetrain<Shape>::kMaxRows] = {};
    const bool regular = drivetrain_.constraintCount() == 0 || drivetrain_.calcRows(state, c0);
    // -g = Q' - J' omega epsilon - n' + Gamma R omega [6]; for constant J it is Q'
    double rate[S];
    drivetrain_.calcCovariantTorqueRate(state, rate);
    drivetrain_.inertia().solve(rate, eta);
    if (drivetrain_.constraintCount() == 0) return true;
    if (!regular) {
      for (int i = 0; i < S; ++i) eta[i] = std::numeric_limits<double>::quiet_NaN();
      return false;
    }
    drivetrain_.solver().constrain(c0, eta, Lambda);
    return true;
  }

  /// d(x')/dx at (t, x), exact where the inertia is constant.
  void calcLinearization(double t, const State& x, Linearization<S, 3>& linearization) {
    if (!drivetrain_.inertia().isConstant()) {
      linearizeByDifferences(*this, t, x, this->readsAngles(), drivetrain_.naturalSize(),
                             linearization);
      return;
    }
    const StateView state = this->view(t, x);
    double eta[S];
    double Lambda[Drivetrain<Shape>::kMaxRows] = {};
    calcJerk(state, eta, Lambda);
    double derivatives[3 * S * S];
    drivetrain_.calcJerkDerivatives(state, eta, Lambda, derivatives);
    for (int q = 0; q < 3 * S; ++q) {
      for (int i = 0; i < S; ++i) linearization.block(q / S)(i, q % S) = derivatives[q * S + i];
    }
  }

  bool keepsConstraintsInStages() const { return drivetrain_.canKeepConstraintsInStages(); }
  /// What implicit steps solve, by the last S rows of x': see Drivetrain. NaN where C has lost
  /// rank.
  [[gnu::noinline]] void calcStageResidual(double t, const State& x, const double* eta,
                                           const Linearization<S, 3>& linearization,
                                           double* residual) {
    if (!drivetrain_.canKeepConstraintsInStages()) {
      State dxdt;
      (*this)(x, dxdt, t);
      for (std::size_t i = 0; i < S; ++i) residual[i] = eta[i] - dxdt[2 * S + i];
      return;
    }
    drivetrain_.countRightHandSide();
    if (!drivetrain_.calcStageResidual(this->view(t, x), eta, linearization.projector(),
                                       linearization.pull(), residual)) {
      std::fill(residual, residual + S, std::numeric_limits<double>::quiet_NaN());
    }
  }
  /// Its derivatives at x.
  void calcStageLinearization(double t, const State& x, const State& /*dxdt*/,
                              Linearization<S, 3>& linearization) {
    if (!drivetrain_.canKeepConstraintsInStages()) {
      linearization.mass().setIdentity();
      calcLinearization(t, x, linearization);
      return;
    }
    const StateView state = this->view(t, x);
    double eta[S];
    double Lambda[Drivetrain<Shape>::kMaxRows] = {};
    calcJerk(state, eta, Lambda);
    double derivatives[3 * S * S];
    drivetrain_.calcStageDerivatives(state, Lambda, linearization.projector(), linearization.pull(),
                                     derivatives);
    linearization.mass() = linearization.projector();
    for (int i = 0; i < S; ++i) {
      for (int q = 0; q < 3 * S; ++q) {
        linearization.block(q / S)(i, q % S) = -derivatives[q * S + i];
      }
    }
  }

  /// Everything that is published, at (t, x). False where C has lost rank.
  bool calcSample(double t, const State& x, Sample* sample) {
    const StateView state = this->view(t, x);
    this->copyState(t, x, sample);
    // R = J epsilon + n - Q
    drivetrain_.calcTorque(state, sample->applied_torque);
    drivetrain_.calcReaction(state, sample->applied_torque, sample->reaction_torque);
    double eta[S];
    const bool regular = calcJerk(state, eta, sample->multiplier);
    // R' = C^T Lambda + Gamma R omega [6]
    double* rate = sample->reaction_torque_rate;
    std::fill(rate, rate + S, 0.0);
    if (!drivetrain_.inertia().isConstant()) {
      drivetrain_.calcConnection(state, sample->reaction_torque, rate);
    }
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      const double* C = drivetrain_.solver().row(m);
      for (int i = 0; i < S; ++i) rate[i] += C[i] * sample->multiplier[m];
    }
    this->calcResiduals(state, eta, sample);
    return regular;
  }
};

}  // namespace variator_sim
