/// A torque that is commanded from outside.
#pragma once

#include "variator_sim/torque.h"

namespace variator_sim {

/// Q[shaft] += gain u,   Q'[shaft] += gain u'.
///
/// Keys: `shaft`, `gain` (default 1) and those of `readCommandInput`. `min`, `max` and `rate` mean
/// the command u, before the gain.
class CommandedTorque : public Torque {
 protected:
  void doConfigure(ComponentContext& context) override;
  void doAddTorque(const StateView& state, double* torque) const override;
  void doAddTorqueRate(const StateView& state, double* torque_rate) const override;
  void doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const override;
  Dependence doTorqueDependence() const override { return {false, false}; }
  Dependence doRateDependence() const override { return {false, false}; }
  std::vector<int> doShafts() const override { return {shaft_}; }

 private:
  int shaft_ = 0;
  int input_ = 0;
  double gain_ = 1.0;
};

}  // namespace variator_sim
