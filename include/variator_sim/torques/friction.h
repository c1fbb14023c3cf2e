#pragma once

#include "variator_sim/torque.h"

namespace variator_sim {

/// Coulomb, Stribeck and viscous friction, between a shaft and the ground (w = omega) or between
/// two shafts through a gear of the ratio i (w = omega_a - i omega_b); i = 1 is a slipping clutch:
///     T(w) = (T_c + (T_s - T_c) exp(-(w/w_s)^2)) tanh(w/w_0) + b w      N m
///     T'   = dT/dw w'                                                   N m/s
///     Q_a += -T,   Q_b += i T.
/// T is odd and infinitely smooth: tanh stands for the sign, so that nothing sticks. Below
/// its limit a load creeps with about w_0 times its part of T_s, and the time constant of a shaft
/// with inertia J is about J w_0/T_s there: choose w_0 with regard to both. It takes the power
/// T w >= 0 out of the drivetrain.
///
/// Keys: `shaft`, or `shafts` [a, b] with `ratio` i (default 1, not 0); `coulomb` T_c >= 0 (N m,
/// default 0), `static` T_s >= T_c (N m, default T_c), `stribeck_speed` w_s > 0 (rad/s, required
/// with `static`), `viscous` b >= 0 (N m s/rad, default 0), `regularization_speed` w_0 > 0 (rad/s,
/// default 0.01).
///
/// Source: Armstrong-Helouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and
/// compensation methods for the control of machines with friction, Automatica 30 (1994) 1083-1138.
class Friction : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {false, false}; }
  Dependence doRateDependence() const override { return {false, false}; }
  std::vector<int> doShafts() const override {
    return b_ < 0 ? std::vector{a_} : std::vector{a_, b_};
  }

 private:
  int a_ = 0;
  int b_ = -1;  ///< -1: the ground
  double ratio_ = 1.0;
  double coulomb_ = 0.0;         ///< T_c
  double excess_ = 0.0;          ///< T_s - T_c
  double stribeck_scale_ = 0.0;  ///< 1/w_s
  double viscous_ = 0.0;         ///< b
  double sign_scale_ = 0.0;      ///< 1/w_0
};

}  // namespace variator_sim
