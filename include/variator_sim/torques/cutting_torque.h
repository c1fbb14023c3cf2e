#pragma once

#include "variator_sim/torque.h"

namespace variator_sim {

/// The torque of a machine tool's cut on its spindle, with a smooth entry and exit:
///     Q  = -T E(t) P(phi) s(omega)                                                  N m
///     E  = S((t - t_b)/h) - S((t - t_e)/h)                     engagement in time, 0 to 1
///     P  = 1 + a sin(z phi + beta)                             passing teeth
///     s  = tanh(omega/w_0)                                     a cut resists, it never drives
///     Q' = -T (E' P s + E P' omega s + E P s' epsilon)                              N m/s
/// S(x) = 10 x^3 - 15 x^4 + 6 x^5 between 0 and 1: two times continuously differentiable. The cut
/// enters from t_b to t_b + h and leaves from t_e to t_e + h; without `end` it does not leave.
///
/// Keys: `shaft`, `torque` T >= 0 (N m), `begin` t_b (s), `ramp` h > 0 (s), `end` t_e >= t_b + h
/// (s, optional), `tooth_passing` (optional): {`teeth` z >= 1 (an integer), `amplitude` a from 0 to
/// 1, `phase` beta (rad, default 0)}, `regularization_speed` w_0 > 0 (rad/s, default 0.1).
///
/// Source: Altintas: Manufacturing Automation (2012), chapter 2 (mean torque and tooth passing in
/// milling); T by Kienzle's law, VDI-Zeitschrift 94 (1952) 299: T = k_c1.1 b h^(1-m) d/2.
class CuttingTorque : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {true, teeth_ > 0.0}; }
  Dependence doRateDependence() const override { return {true, teeth_ > 0.0}; }
  std::vector<int> doShafts() const override { return {shaft_}; }
  // The third derivative of E jumps at the ends of both ramps.
  std::vector<double> doInstants() const override {
    const double ramp = 1.0 / ramp_scale_;
    return {begin_, begin_ + ramp, end_, end_ + ramp};
  }

 private:
  int shaft_ = 0;
  double torque_ = 0.0;      ///< T
  double begin_ = 0.0;       ///< t_b
  double end_ = 0.0;         ///< t_e, or infinity
  double ramp_scale_ = 0.0;  ///< 1/h
  double teeth_ = 0.0;       ///< z; 0: no harmonic
  double amplitude_ = 0.0;   ///< a
  double phase_ = 0.0;       ///< beta
  double sign_scale_ = 0.0;  ///< 1/w_0
};

}  // namespace variator_sim
