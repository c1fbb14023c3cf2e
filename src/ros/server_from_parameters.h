/// Makes a simulation from the parameter server.
#pragma once

#include <memory>

namespace ros {
class NodeHandle;
}

namespace variator_sim {

/// Reads the scene and the node's settings from the private parameters and starts a server, which
/// runs until it is destroyed. Throws std::runtime_error with a message that begins with the
/// parameter's full name.
std::shared_ptr<void> makeServerFromParameters(const ros::NodeHandle& public_handle,
                                               const ros::NodeHandle& private_handle);

}  // namespace variator_sim
