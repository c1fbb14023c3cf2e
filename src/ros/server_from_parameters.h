/// Makes a simulation from the parameter server.
#pragma once

#include <memory>

namespace ros {
class NodeHandle;
}

namespace variator_sim {

class SimulationServer;

/// Reads the scene and the node's settings from the private parameters and starts a server, which
/// runs until it is destroyed. Throws std::runtime_error with a message that begins with the
/// parameter's full name. The shared pointer spares programs and nodelets the server's header with
/// all of roscpp and all messages.
std::shared_ptr<SimulationServer> makeServerFromParameters(const ros::NodeHandle& public_handle,
                                                           const ros::NodeHandle& private_handle);

}  // namespace variator_sim
