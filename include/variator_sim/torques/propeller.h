#pragma once

#include "variator_sim/torque.h"

namespace variator_sim {

/// A propeller (or a fan), positive speed ahead. With w = omega (rad/s), n = w/(2 pi) (1/s) and
/// a(x) the magnitude of x:
///     Q  = -k w a(w),   k = rho K_Q0 D^5 / (2 pi)^2               (bollard condition)       N m
///     Q  = -k w a(w) + m a(w),   m = rho K_Q1 V D^4 / (2 pi)      (water coming in at V)    N m
///     Q' = -(k a(w) + (k w - m) a'(w)) epsilon                                              N m/s
/// The second is Q = -rho D^5 n |n| K_Q(J) with K_Q(J) = K_Q0 - K_Q1 J, J = V/(n D), in the
/// bilinear form that is regular at n = 0. Source: Fossen: Handbook of Marine Craft Hydrodynamics
/// and Motion Control (2011), section 9.1; after Blanke (1981).
///
/// a(w) = |w| exactly by default: the rate is then continuous, with a kink at w = 0 where the shaft
/// turns round (but for an inflow, where it would jump: there w_0 has to be given). With a
/// `regularization_speed` w_0 > 0 the law is smooth, a(w) = w^2/sqrt(w^2 + w_0^2), and differs from
/// the exact one by the part (w_0/w)^2/2.
///
/// Keys: `shaft`, either
///   `coefficient` k >= 0 (N m s^2/rad^2), or
///   `torque_coefficient` K_Q0 >= 0, `diameter` D > 0 (m), `density` rho > 0 (kg/m^3, default 1025:
///   sea water), and optionally `advance`: {`speed` V (m/s, any sign: the ship's speed less the
///   wake), `slope` K_Q1 >= 0}
/// and `regularization_speed` w_0 >= 0 (rad/s, default 0; > 0 and not optional with `advance`).
class Propeller : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {false, false}; }
  Dependence doRateDependence() const override { return {false, false}; }
  std::vector<int> doShafts() const override { return {shaft_}; }
  std::vector<GuardPtr> doGuards() const override {
    if (regularization_speed_ > 0.0) return {};
    return {std::make_shared<KnotGuard>(KnotGuard::Part::kVelocity, shaft_, std::vector{0.0})};
  }

 private:
  int shaft_ = 0;
  double quadratic_ = 0.0;             ///< k, N m s^2/rad^2
  double bilinear_ = 0.0;              ///< m, N m s/rad
  double regularization_speed_ = 0.0;  ///< w_0, rad/s
};

}  // namespace variator_sim
