#pragma once

#include "variator_sim/constraints/time_value.h"

namespace variator_sim {

/// A variator without slip whose ratio is imposed, order 1 (rad/s), on the shafts a and b:
///     f = omega_b - i(t) omega_a
/// Source: Artobolevskii, Zinov'ev, Umnov: Equations of motion of a machine aggregate with a
/// variator, Dokl. Akad. Nauk SSSR 173 (1967) no. 5, 1017-1020 (in Russian).
///
/// Keys: `shafts` [a, b], `ratio` i (a number, a table over time, or commanded through
/// `second_order_lag`: f is differentiated twice, and so is i).
class KinematicRatio : public AutomaticConstraint<KinematicRatio, 1, 2, 1> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    return x.velocity[1] - ratio_(x) * x.velocity[0];
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  Dependence doDependence() const override { return {ratio_.readsTime(), false}; }
  bool doHasConstantJacobian() const override { return ratio_.isConstant(); }

  // f'' has the second derivative of the value, which has a kink at the points of a table.
  std::vector<double> doInstants() const override { return ratio_.instants(); }

 private:
  TimeValue ratio_;
};

}  // namespace variator_sim
