/// What can be changed while the node runs, by dynamic_reconfigure.
#pragma once

#include <memory>

namespace ros {
class NodeHandle;
}

namespace variator_sim {

class SteppingLoop;
struct NodeSettings;

/// Serves `real_time_factor` and `publish_rate`. A value that is not allowed is refused with a
/// warning, and what is in force stays. Its service is called in the thread that serves the node
/// handle's callback queue.
class LiveSettings {
 public:
  /// `handle` is the private one. `follows_clock`: the pace is not ours to change.
  LiveSettings(const ros::NodeHandle& handle, const NodeSettings& settings, bool follows_clock,
               SteppingLoop& loop);
  ~LiveSettings();

 private:
  class Server;
  std::unique_ptr<Server> server_;
};

}  // namespace variator_sim
