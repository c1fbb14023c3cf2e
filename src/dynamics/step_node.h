/// An end of a step.
#pragma once

#include "dynamics/state_vector.h"

namespace variator_sim {

class System;

/// A state of a motion and its derivative.
struct StepNode {
  explicit StepNode(const System& system);
  StepNode(double t, const State& at, const State& slope)
      : time(t), x(at), dxdt(slope), torque(0), torque_rate(0) {}
  double time = 0.0;
  State x;
  State dxdt;
  ShaftVector torque;       ///< Q there, N m, where StepChecks has written it
  ShaftVector torque_rate;  ///< Q' there, N m/s, likewise
};

}  // namespace variator_sim
