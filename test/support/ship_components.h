/// The ship scene's torques and constraint written by hand in C++: what a user's own plugin looks
/// like, and a peer that the typed formulas are checked and timed against.
#pragma once

#include <cmath>

#include "variator_sim/constraint.h"
#include "variator_sim/torque.h"

namespace variator_sim::test {

/// Kloss characteristic M = 12 s / (s^2 + 0.04), slip s = (50 - omega_1) / 50, on shaft 1.
class ShipMotor : public Torque {
 protected:
  void doConfigure(ComponentContext& /*context*/) override {}
  void doAddTorque(const StateView& x, double* torque) const override {
    const double s = (50.0 - x.velocity[0]) / 50.0;
    torque[0] += 12.0 * s / (s * s + 0.04);
  }
  void doAddTorqueRate(const StateView& x, double* rate) const override {
    const double s = (50.0 - x.velocity[0]) / 50.0;
    const double d = s * s + 0.04;
    // dM/ds = 12 (0.04 - s^2) / d^2, ds/dt = -epsilon_1 / 50
    rate[0] += 12.0 * (0.04 - s * s) / (d * d) * (-x.acceleration[0] / 50.0);
  }
};

/// M = -0.02 omega_2^2 on shaft 2.
class ShipPropeller : public Torque {
 protected:
  void doConfigure(ComponentContext& /*context*/) override {}
  void doAddTorque(const StateView& x, double* torque) const override {
    torque[1] -= 0.02 * x.velocity[1] * x.velocity[1];
  }
  void doAddTorqueRate(const StateView& x, double* rate) const override {
    rate[1] -= 0.04 * x.velocity[1] * x.acceleration[1];
  }
};

/// psi = tau (eps2 - i eps1)(1 + 0.05 (eps1^2 + eps2^2)) + omega2 - i omega1,
/// i = 0.6 + 0.2 sin(0.7 t), tau = 0.2.
class ShipVariator : public Constraint {
 protected:
  void doConfigure(ComponentContext& /*context*/) override {}
  double doCalcResidual(const StateView& x) const override {
    const double* e = x.acceleration;
    const double i = calcRatio(x.time);
    return kTau * (e[1] - i * e[0]) * (1.0 + 0.05 * (e[0] * e[0] + e[1] * e[1])) + x.velocity[1] -
           i * x.velocity[0];
  }
  void doCalcPartials(const StateView& x, ConstraintPartials& p) const override {
    const double* e = x.acceleration;
    const double i = calcRatio(x.time);
    const double di = 0.14 * std::cos(0.7 * x.time);
    const double slip = e[1] - i * e[0];
    const double g = 1.0 + 0.05 * (e[0] * e[0] + e[1] * e[1]);
    p.time = -di * (kTau * g * e[0] + x.velocity[0]);
    p.velocity[0] = -i;
    p.velocity[1] = 1.0;
    p.acceleration[0] = kTau * (-i * g + 0.1 * slip * e[0]);
    p.acceleration[1] = kTau * (g + 0.1 * slip * e[1]);
  }

 private:
  static constexpr double kTau = 0.2;
  static double calcRatio(double t) { return 0.6 + 0.2 * std::sin(0.7 * t); }
};

}  // namespace variator_sim::test
