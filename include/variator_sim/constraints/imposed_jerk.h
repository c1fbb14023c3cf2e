#pragma once

#include "variator_sim/constraints/time_value.h"

namespace variator_sim {

/// A kinematically controlled start, order 3 (rad/s^3): the jerk of one shaft is a given function
/// of time,
///     eta - j(t) = 0.
/// Either j as it is, or the smooth start that changes the speed by Delta within T from t_0 on,
///     epsilon = (Delta/T) (1 - cos z),  j = (2 pi Delta/T^2) sin z,  z = 2 pi (t - t_0)/T,
/// with no acceleration at both ends; before and after j = 0, so the shaft keeps the acceleration
/// it has (its initial one, if that is not 0). After Arkhangel'skii, Gorin: Questions of finding
/// optimal motions of kinematically controlled systems, in: Stepless transmissions, Yaroslavl 1984,
/// 54-58 (in Russian): the idea; the profile is our choice.
///
/// Keys: `shaft`, and either `jerk` j (rad/s^3: a number, a table over time, or commanded with any
/// hold) or `velocity_change` Delta (rad/s), `duration` T > 0 (s), `start` t_0 >= 0 (s, default 0).
class ImposedJerk : public AutomaticConstraint<ImposedJerk, 3, 1, 1> {
 public:
  template <class T>
  T residual(const GenericState<T>& x) const {
    if (duration_ == 0.0) return x.jerk[0] - jerk_(x);
    const T z = (x.time - start_) * (kTwoPi / duration_);
    if (z < 0.0 || z > kTwoPi) return x.jerk[0];
    return x.jerk[0] - kTwoPi * velocity_change_ / (duration_ * duration_) * sin(z);
  }

 protected:
  void doConfigure(ComponentContext& context) override;
  Dependence doDependence() const override { return {duration_ > 0.0 || jerk_.readsTime(), false}; }
  std::vector<double> doInstants() const override {
    if (duration_ == 0.0) return jerk_.instants();
    return {start_, start_ + duration_};
  }
  bool doHasConstantJacobian() const override { return true; }
  bool doIsLinearInAcceleration() const override { return true; }

 private:
  static constexpr double kTwoPi = 6.283185307179586;
  TimeValue jerk_;
  double velocity_change_ = 0.0;  ///< Delta, rad/s
  double duration_ = 0.0;         ///< T, s; 0: jerk_ is given
  double start_ = 0.0;            ///< t_0, s
};

}  // namespace variator_sim
