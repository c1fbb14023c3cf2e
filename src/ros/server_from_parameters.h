/// A simulation as the parameter server describes it.
#pragma once

#include <memory>

namespace ros {
class NodeHandle;
}

namespace variator_sim {

class SimulationServer;

/// Whether messages are handed to subscribers in the same process as they are. Then each message is
/// a new one; otherwise one is filled again and again.
enum class Sharing { kNothing, kMessages };

/// Reads the scene and the node's settings from the private parameters and starts; what is returned
/// runs until it is destroyed. Throws std::runtime_error with a message that begins with the
/// parameter's full name. A shared pointer: whoever holds it needs no more of the server, and its
/// header with all of roscpp and all messages stays out of programs and nodelets.
std::shared_ptr<SimulationServer> makeServerFromParameters(const ros::NodeHandle& public_handle,
                                                           const ros::NodeHandle& private_handle,
                                                           Sharing sharing);

}  // namespace variator_sim
