#pragma once

#include "variator_sim/table.h"
#include "variator_sim/torque.h"
#include "variator_sim/torques/input_value.h"

namespace variator_sim {

/// A Diesel engine in the mean over its cycles: the full-load torque of a table over the speed
/// times the rack (the part of full fuel, 0 to 1), less the friction; an idle governor may add
/// rack.
///     Q   = r T(w) - F(w)                                          N m,   w = omega, rad/s
///     r   = u + (1 - u) g(w)                                       rack in force, from u to 1
///     g   = 1 - S((w - w_i + b) / (2 b))                           idle governor: 1 below w_i - b,
///                                                                  1/2 at w_i, 0 above w_i + b
///     F   = F_0 tanh(w/w_0) + F_1 w
///     Q'  = r' T + (r dT/dw - dF/dw) epsilon,   r' = (1 - g) u' + (1 - u) dg/dw epsilon
/// S is the step of degree five, so Q is two times continuously differentiable: the table is
/// (table.h), it does not overshoot, and beyond its ends it keeps its first and its last value.
/// Nothing stalls the engine by itself: let the table fall to 0 towards speed 0, and towards the
/// speed at which the fuel is cut.
///
/// Keys: `shaft`, `full_load`: {`speed` (rad/s, increasing), `torque` >= 0 (N m)}, `rack` u (a
/// number from 0 to 1 or a commanded input, see InputValue), and optionally
///   `friction`: {`constant` F_0 >= 0 (N m), `linear` F_1 >= 0 (N m s/rad, default 0),
///                `regularization_speed` w_0 > 0 (rad/s, default 1)}
///   `idle_governor`: {`speed` w_i > 0 (rad/s), `band` b > 0 (rad/s)}
///
/// Source: Guzzella, Onder: Introduction to Modeling and Control of Internal Combustion Engine
/// Systems (2010), chapter 2 (mean values, friction over speed); the smooth governor is ours.
class DieselEngine : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {false, false}; }
  Dependence doRateDependence() const override { return {false, false}; }
  std::vector<int> doShafts() const override { return {shaft_}; }
  std::vector<GuardPtr> doGuards() const override {
    std::vector<double> speeds = full_load_.points();
    // the ends of the governor's band
    if (has_governor_) {
      speeds.insert(speeds.end(), {governor_begin_, governor_begin_ + 1.0 / governor_scale_});
    }
    return {std::make_shared<KnotGuard>(KnotGuard::Part::kVelocity, shaft_, std::move(speeds))};
  }

 private:
  int shaft_ = 0;
  Table full_load_;  ///< T(w)
  InputValue rack_;  ///< u
  double friction_constant_ = 0.0;
  double friction_linear_ = 0.0;
  double friction_scale_ = 0.0;  ///< 1/w_0
  bool has_governor_ = false;
  double governor_begin_ = 0.0;  ///< w_i - b
  double governor_scale_ = 0.0;  ///< 1/(2 b)
};

}  // namespace variator_sim
