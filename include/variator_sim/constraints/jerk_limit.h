#pragma once

#include "variator_sim/constraints/time_value.h"

namespace variator_sim {

/// An acceleration that follows its target with limited jerk, order 3 (rad/s^3):
///     eta = j tanh((a - epsilon) / (j tau))
/// Near the target a it approaches like exp(-t/tau); far away the jerk is +-j. A target that steps
/// is thus a start without a jolt. After the kinematically controlled starts of Arkhangel'skii and
/// Gorin (see ImposedJerk); the law is our choice.
///
/// Keys: `shaft`, `limit` j > 0 (rad/s^3), `time_constant` tau > 0 (s), `acceleration` a (rad/s^2:
/// a number, a table over time, or commanded with any hold).
class JerkLimit : public AutomaticConstraint<JerkLimit, 3, 1, 1> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    return x.jerk[0] -
           limit_ * tanh((acceleration_(x) - x.acceleration[0]) / (limit_ * time_constant_));
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  std::vector<double> doInstants() const override { return acceleration_.instants(); }
  Dependence doDependence() const override { return {acceleration_.readsTime(), false}; }
  bool doHasConstantJacobian() const override { return true; }
  bool doIsLinearInAcceleration() const override { return true; }

 private:
  double limit_ = 1.0;          ///< j, rad/s^3
  double time_constant_ = 1.0;  ///< tau, s
  TimeValue acceleration_;      ///< a, rad/s^2
};

}  // namespace variator_sim
