#pragma once

#include "variator_sim/constraints/time_value.h"

namespace variator_sim {

/// A variator whose slip relaxes, order 2 (rad/s), on the shafts a and b:
///     psi = tau (epsilon_b - i epsilon_a) + omega_b - i omega_a
/// With i constant the slip omega_b - i omega_a decays as exp(-t/tau), whatever the torques. A
/// commanded i that jumps moves the accelerations as a jump of torque does: tau > 0 leaves the
/// speeds as they are. Own formulation: slip of first order, the simplest law linear in epsilon.
///
/// Keys: `shafts` [a, b], `time_constant` tau > 0 (s), `ratio` i (a number, a table over time, or
/// commanded with any hold).
///
/// Outputs: `slip` omega_b - i omega_a (rad/s), `ratio` i.
class SlipRatio : public AutomaticConstraint<SlipRatio, 2, 2, 1> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    const T i = ratio_(x);
    return time_constant_ * (x.acceleration[1] - i * x.acceleration[0]) + x.velocity[1] -
           i * x.velocity[0];
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  std::vector<double> doInstants() const override { return ratio_.instants(); }
  Dependence doDependence() const override { return {ratio_.readsTime(), false}; }
  bool doHasConstantJacobian() const override { return ratio_.isConstant(); }
  bool doIsLinearInAcceleration() const override { return true; }
  std::vector<std::string> doOutputNames() const override { return {"slip", "ratio"}; }
  void doCalcOutputs(const StateView& state, double* values) const override {
    const double i = ratio_.value(state);
    values[0] = state.velocity[shaft(1)] - i * state.velocity[shaft(0)];
    values[1] = i;
  }

 private:
  double time_constant_ = 1.0;  ///< tau, s
  TimeValue ratio_;
};

}  // namespace variator_sim
