/// Settings that dynamic_reconfigure changes while the node runs.
#pragma once

#include <memory>

namespace ros {
class NodeHandle;
}

namespace variator_sim {

class SteppingLoop;
struct NodeSettings;

/// Serves `real_time_factor` and `publish_rate`. Rejects values out of range with a warning and
/// keeps the present ones. Its service runs in the thread that serves the node handle's callback
/// queue.
class LiveSettings {
 public:
  /// `handle` is the private one. `follows_clock`: a followed clock sets the pace.
  LiveSettings(const ros::NodeHandle& handle, const NodeSettings& settings, bool follows_clock,
               SteppingLoop& loop);
  ~LiveSettings();

 private:
  class Server;
  std::unique_ptr<Server> server_;
};

}  // namespace variator_sim
