#pragma once

#include "variator_sim/table.h"
#include "variator_sim/torque.h"
#include "variator_sim/torques/input_value.h"

namespace variator_sim {

/// A motor by its steady torque-speed characteristic. With d = +-1 the direction of rotation it is
/// built for and w = d omega its speed in that direction (rad/s):
///     Q  = d u M(w)                              N m
///     Q' = d (u' M(w) + u M'(w) d epsilon)       N m/s
/// u is the command from 0 to 1 (a throttle, a current limit), 1 when there is none.
///
/// `characteristic`:
///   kloss  induction motor: breakdown torque M_k at the slip s_k, synchronous speed w_s;
///              M = 2 M_k / (s/s_k + s_k/s) = 2 M_k x / (1 + x^2),  s = (w_s - w)/w_s,  x = s/s_k
///          (the second form is regular at s = 0). Above w_s it brakes. Stator resistance
///          neglected. Source: M. Kloss, Archiv fuer Elektrotechnik 5 (1916) 59-87.
///   table  M through measured points over w: two times continuously differentiable, no overshoot
///          (table.h). Beyond the ends by `beyond`: constant (default) or linear.
///   dc     permanent-magnet or separately excited DC motor, inductance neglected; either
///              M = M_0 (1 - w/w_0)          stall torque M_0, no-load speed w_0
///          or by its circuit, with the commanded or constant voltage U and no u:
///              M = k (U - k w)/R            k torque constant, R resistance of the armature
///              Q' = d k (U' - k d epsilon)/R
///          Source: Fitzgerald, Kingsley, Umans: Electric Machinery, chapter 7.
///
/// Keys: `shaft`, `characteristic`, `direction` (1 or -1, default 1), `command` (optional: a number
/// from 0 to 1 or a commanded input, see InputValue; not with `voltage`), and
///   kloss  `breakdown_torque` > 0 (N m), `synchronous_speed` > 0 (rad/s), `critical_slip` > 0
///   table  `table`: {`speed` (rad/s, increasing), `torque` (N m), `beyond`: constant | linear}
///   dc     `stall_torque` > 0 (N m), `no_load_speed` > 0 (rad/s), or
///          `torque_constant` k > 0 (N m/A = V s/rad), `resistance` R > 0 (ohm), `voltage` U (V: a
///          number or a commanded input)
class MotorCurve : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {false, false}; }
  Dependence doRateDependence() const override { return {false, false}; }
  std::vector<int> doShafts() const override { return {shaft_}; }
  std::vector<GuardPtr> doGuards() const override {
    std::vector<double> speeds = table_.points();
    if (speeds.empty()) return {};
    for (double& speed : speeds) speed *= direction_;
    return {std::make_shared<KnotGuard>(KnotGuard::Part::kVelocity, shaft_, std::move(speeds))};
  }

 private:
  enum class Characteristic { kKloss, kTable, kLine, kCircuit };

  void configureKloss(ComponentContext& context);
  void configureTable(ComponentContext& context);
  void configureDc(ComponentContext& context);

  int shaft_ = 0;
  double direction_ = 1.0;
  Characteristic characteristic_ = Characteristic::kKloss;
  InputValue input_{1.0};  ///< u; of kCircuit: U

  double peak_ = 0.0;          ///< of kKloss: 2 M_k
  double slip_at_rest_ = 0.0;  ///< of kKloss: x = slip_at_rest - slip_slope w
  double slip_slope_ = 0.0;
  Table table_;                ///< of kTable: M(w)
  double stall_torque_ = 0.0;  ///< of kLine: M = stall_torque - damping w
  double voltage_gain_ = 0.0;  ///< of kCircuit: M = voltage_gain U - damping w
  double damping_ = 0.0;
};

}  // namespace variator_sim
