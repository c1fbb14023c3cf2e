/// Names that the node reserves in a scene: it reads its own parameters from the same tree and
/// publishes beside the scene's topics.
#pragma once

#include <string>
#include <vector>

namespace variator_sim {

/// Names that a program which runs scenes reserves ("the node" in messages).
struct NodeNames {
  /// Keys at the scene's root that the program reads. A scene may have them without effect; no
  /// shaft, torque or constraint may take them.
  std::vector<std::string> keys;
  /// Private topics that the program publishes. No commanded input may take one: the program would
  /// read its own messages.
  std::vector<std::string> topics;
};

/// Returns the names of variator_sim_node.
inline NodeNames nodeNames() {
  return {{"tick_rate", "publish_rate", "real_time_factor", "publish_clock", "start_paused",
           "realtime_priority", "lock_memory", "estimate_error", "overrides", "scene_folder"},
          {"state", "elements", "inputs", "outputs", "states", "variables", "principle", "energy",
           "events", "scene", "status", "commands", "parameter_descriptions", "parameter_updates"}};
}

}  // namespace variator_sim
