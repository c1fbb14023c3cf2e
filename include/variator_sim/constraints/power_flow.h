#pragma once

#include "variator_sim/constraints/time_value.h"

namespace variator_sim {

/// Power into the masses of two shafts, order 2 (W). In one of two forms:
///     psi = J_a omega_a epsilon_a + J_b omega_b epsilon_b - P            imposed power P
///     psi = p_b - eta p_a  (p_a > 0),   p_b - p_a / eta  (p_a < 0)       efficiency eta
/// where p_a = -J_a omega_a epsilon_a is the power that the mass of a gives and
/// p_b = J_b omega_b epsilon_b the power that the mass of b takes. With P the kinetic energy of the
/// two is T(0) + integral of P dt. With eta one mass is speeded up by the other, as in a flywheel
/// drive, and the part 1 - eta of the power is lost in whichever direction it flows; the two
/// branches are joined smoothly, p_0 wide:
///     psi = p_b - m p_a + n (sqrt(p_a^2 + p_0^2) - p_0),  m = (1/eta + eta)/2, n = (1/eta - eta)/2
/// Both leave C = 0 at rest, where power decides nothing: the scene has to start in motion.
/// Own formulation; J are those of the scene's shafts (constant inertia).
///
/// Keys: `shafts` [a, b], `inertias` [J_a, J_b] > 0 (kg m^2), and either `power` P (W: a number, a
/// table over time, or commanded with any hold) or `efficiency` 0 < eta <= 1 with
/// `smoothing_power` p_0 > 0 (W).
class PowerFlow : public AutomaticConstraint<PowerFlow, 2, 2, 1> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    const T given = -inertia_a_ * x.velocity[0] * x.acceleration[0];
    const T taken = inertia_b_ * x.velocity[1] * x.acceleration[1];
    if (imposes_power_) return taken - given - power_(x);
    const double p0 = smoothing_power_;
    return taken - 0.5 * (1.0 / efficiency_ + efficiency_) * given +
           0.5 * (1.0 / efficiency_ - efficiency_) * (sqrt(given * given + p0 * p0) - p0);
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  std::vector<double> doInstants() const override { return power_.instants(); }
  Dependence doDependence() const override { return {power_.readsTime(), false}; }
  bool doIsLinearInAcceleration() const override { return imposes_power_; }

 private:
  bool imposes_power_ = true;
  double inertia_a_ = 1.0;        ///< J_a, kg m^2
  double inertia_b_ = 1.0;        ///< J_b, kg m^2
  TimeValue power_;               ///< P, W
  double efficiency_ = 1.0;       ///< eta
  double smoothing_power_ = 1.0;  ///< p_0, W
};

}  // namespace variator_sim
