/// Reads and sets states of a running motion. It does not depend on ROS.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/motion_state.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {

class Simulation;

/// A request, owned by its caller, and by the stepping thread while that serves it.
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

/// Sets the requested state. Returns "", or why not: then the motion is unchanged. Allocates.
std::string changeState(Simulation& simulation, const StateExchange& exchange);

}  // namespace variator_sim
