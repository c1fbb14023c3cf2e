/// The state of two shafts and one constraint, as the node's is.
#pragma once

#include <variator_sim/DrivetrainState.h>

namespace variator_sim::benchmark {

/// As many numbers as the node sends.
inline void fill(DrivetrainState& state, double value) {
  for (auto* values : {&state.angle, &state.velocity, &state.acceleration, &state.applied_torque,
                       &state.reaction_torque, &state.reaction_torque_rate}) {
    values->assign(2, value);
  }
  state.residual.assign(1, value);
  state.multiplier.assign(1, value);
}

}  // namespace variator_sim::benchmark
