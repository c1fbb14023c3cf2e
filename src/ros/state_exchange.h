/// States of the motion that are asked for and set while it runs. Knows nothing of ROS.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/motion_state.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {

class Simulation;

/// Of whoever asks, and the stepping thread's while it serves.
struct StateExchange {
  // To be set.
  ParameterTree change = ParameterTree::dictionary();  ///< of readMotionState
  std::vector<double> angle;  ///< as many as there are shafts, or none, as the next two
  std::vector<double> velocity;
  std::vector<double> acceleration;
  bool project = false;
  // Saved.
  MotionState state;
};

/// Sets what `exchange` asks for. "" or why not: then nothing has changed. Allocates.
std::string changeState(Simulation& simulation, const StateExchange& exchange);

}  // namespace variator_sim
