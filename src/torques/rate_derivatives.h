/// Where the derivatives of a torque's rate by the state belong.
#pragma once

#include "variator_sim/types.h"

namespace variator_sim {

/// The array of Torque::addTorqueRateDerivatives: dQ'_of/dx_by, x one of phi, omega, epsilon of the
/// shaft `by`. [loop]
class RateDerivatives {
 public:
  RateDerivatives(double* values, int shaft_count) : values_(values), shaft_count_(shaft_count) {}

  double& byAngle(int by, int of) { return at(0, by, of); }
  double& byVelocity(int by, int of) { return at(1, by, of); }
  double& byAcceleration(int by, int of) { return at(2, by, of); }

 private:
  double& at(int part, int by, int of) {
    return values_[(part * shaft_count_ + by) * shaft_count_ + of];
  }

  double* values_;
  int shaft_count_;
};

}  // namespace variator_sim
