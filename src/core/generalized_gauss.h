/// The system of the generalized Gauss principle: x = (phi, omega, epsilon), x' = (omega, epsilon,
/// eta) with the jerk whose reaction changes least.
#pragma once

#include "acceleration_system.h"

namespace variator_sim {

/// See AccelerationSystem for what it has beside its derivative and its sample.
template <int S>
class GeneralizedGauss : public AccelerationSystem<S> {
  using Base = AccelerationSystem<S>;
  using Base::drivetrain_;

 public:
  using typename Base::State;

  explicit GeneralizedGauss(const Scene& scene) : Base(scene, false) {}

  /// x' at (t, x): the system as Boost.Odeint calls it. NaN where C has lost rank.
  void operator()(const State& x, State& dxdt, double t) {
    this->copyRates(x, dxdt);
    double Lambda[Drivetrain<S>::kMaxRows] = {};
    calcJerk(this->view(t, x), &dxdt[2 * S], Lambda);
  }

  /// eta and Lambda. False, and eta NaN, where C has lost rank.
  bool calcJerk(const StateView& state, double* eta, double* Lambda) {
    drivetrain_.countRightHandSide();
    // -g = Q' - J' omega epsilon - n' + Gamma R omega [6]; for constant J it is Q'
    double rate[S];
    drivetrain_.calcFreeTorqueRate(state, rate);
    if (!drivetrain_.inertia().isConstant()) {
      double torque[S];
      double reaction[S];
      double connection[S];
      drivetrain_.calcTorque(state, torque);
      drivetrain_.calcReaction(state, torque, reaction);
      drivetrain_.calcConnection(state, reaction, connection);
      for (int i = 0; i < S; ++i) rate[i] += connection[i];
    }
    drivetrain_.inertia().solve(rate, eta);
    if (drivetrain_.constraintCount() == 0) return true;
    double c0[Drivetrain<S>::kMaxRows] = {};
    if (!drivetrain_.calcRows(state, c0)) {
      for (int i = 0; i < S; ++i) eta[i] = std::numeric_limits<double>::quiet_NaN();
      return false;
    }
    drivetrain_.solver().constrain(c0, eta, Lambda);
    return true;
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
