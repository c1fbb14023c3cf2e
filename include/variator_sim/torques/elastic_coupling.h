#pragma once

#include "variator_sim/torque.h"

namespace variator_sim {

/// A massless elastic link with damping between the shafts a and b, through an ideal gear of the
/// ratio i (the link is at rest where phi_a = i phi_b):
///     T  = k (phi_a - i phi_b) + c (omega_a - i omega_b)          N m
///     T' = k (omega_a - i omega_b) + c (epsilon_a - i epsilon_b)  N m/s
///     Q_a += -T,   Q_b += i T.
/// It takes the power c (omega_a - i omega_b)^2 >= 0 out of the drivetrain; the rest it stores in
/// k (phi_a - i phi_b)^2 / 2.
///
/// Keys: `shafts` [a, b], `stiffness` k > 0 (N m/rad), `damping` c >= 0 (N m s/rad, default 0),
/// `ratio` i, not 0 (default 1; negative: the shafts turn against each other).
///
/// Source: the Kelvin-Voigt link of torsional vibration; Dresig, Holzweissig: Dynamics of Machinery
/// (2010), chapter 4.
class ElasticCoupling : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {false, true}; }
  Dependence doRateDependence() const override { return {false, false}; }
  std::vector<int> doShafts() const override { return {a_, b_}; }

 private:
  int a_ = 0;
  int b_ = 0;
  double stiffness_ = 0.0;
  double damping_ = 0.0;
  double ratio_ = 1.0;
};

}  // namespace variator_sim
