/// Settings that dynamic_reconfigure changes while the node runs.
#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace variator_sim {

class SteppingLoop;
struct NodeSettings;

/// Serves `real_time_factor` and `publish_rate` while the result exists. Rejects values out of
/// range with a warning and keeps the present ones. The service runs in the thread that serves the
/// callback queue of `handle`, the private one. `follows_clock`: a followed clock sets the pace.
std::shared_ptr<void> serveSettings(const ros::NodeHandle& handle, const NodeSettings& settings,
                                    bool follows_clock, SteppingLoop& loop);

}  // namespace variator_sim
