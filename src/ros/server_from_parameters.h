/// A simulation as the parameter server describes it.
#pragma once

#include <memory>

#include "ros/simulation_server.h"

namespace variator_sim {

/// Reads the scene and the node's settings from the private parameters and starts. Throws
/// std::runtime_error with a message that begins with the parameter's full name.
std::unique_ptr<SimulationServer> makeServerFromParameters(const ros::NodeHandle& public_handle,
                                                           const ros::NodeHandle& private_handle,
                                                           Sharing sharing);

}  // namespace variator_sim
