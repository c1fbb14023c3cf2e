#pragma once

#include "variator_sim/constraints/time_value.h"

namespace variator_sim {

/// An automatic V-belt variator, order 1 (rad/s), driving pulley a, driven pulley b:
///     f = omega_b - i omega_a,    i = i_1 + (i_2 - i_1) (1 + tanh y)/2,
///     y = ((omega_a/omega_0)^2 - 1 - M/M_0) / w
/// The flyweights of the driving pulley press its sheaves together with a force that grows with
/// omega_a^2; the spring of the driven pulley, and its cams with the load M, press back. At low
/// speed the ratio is i_1 (starting), at high speed i_2; it stands half-way at omega_0 when nothing
/// loads it; a load keeps it down. tanh is the smooth stop at both ends, w how gradual the way
/// between them is. The structure (a first-order constraint whose ratio follows speed and load) is
/// that of Pronin, Petrov, Balovnev: Equations of motion of an automatic V-belt variator of a motor
/// vehicle, Avtomobil'naya promyshlennost' 1979 no. 9, 15-18 (in Russian); the law is our
/// simplification.
///
/// Keys: `shafts` [a, b], `ratio_low` i_1 > 0, `ratio_high` i_2 > i_1, `speed` omega_0 > 0 (rad/s),
/// `width` w > 0 (default 0.5), and optionally `load` M (N m: a number, a table over time, or
/// commanded through `second_order_lag`) with `load_torque` M_0 > 0 (N m).
class VBeltRatio : public AutomaticConstraint<VBeltRatio, 1, 2, 1> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    const T speed = x.velocity[0] / speed_;
    const T y = (speed * speed - 1.0 - load_(x) / load_torque_) / width_;
    const T i = ratio_low_ + 0.5 * (ratio_high_ - ratio_low_) * (1.0 + tanh(y));
    return x.velocity[1] - i * x.velocity[0];
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  Dependence doDependence() const override { return {load_.readsTime(), false}; }

  std::vector<double> doInstants() const override { return load_.instants(); }

 private:
  double ratio_low_ = 1.0;    ///< i_1
  double ratio_high_ = 2.0;   ///< i_2
  double speed_ = 1.0;        ///< omega_0, rad/s
  double width_ = 0.5;        ///< w
  TimeValue load_;            ///< M, N m
  double load_torque_ = 1.0;  ///< M_0, N m
};

}  // namespace variator_sim
