#pragma once

#include "variator_sim/constraints/automatic_constraint.h"

namespace variator_sim {

/// The accelerations of two shafts on a circle, order 2 (rad^2/s^4):
///     psi = epsilon_a^2 + epsilon_b^2 - a^2
/// The simplest constraint that is nonlinear in the accelerations; its motion is known in closed
/// form (doc/theory.md). A start at rest needs `initial/acceleration`, or torques that decide where
/// on the circle it begins.
///
/// Keys: `shafts` [a, b], `magnitude` a > 0 (rad/s^2).
class AccelerationMagnitude : public AutomaticConstraint<AccelerationMagnitude> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    const T* e = x.acceleration;
    return e[0] * e[0] + e[1] * e[1] - magnitude_ * magnitude_;
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  Dependence doDependence() const override { return {false, false}; }

 private:
  double magnitude_ = 1.0;  ///< a, rad/s^2
};

}  // namespace variator_sim
