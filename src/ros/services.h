/// The node's services, and the settings that dynamic_reconfigure changes while it runs.
#pragma once

#include <ros/ros.h>

#include <memory>
#include <vector>

#include "variator_sim/scene.h"

namespace variator_sim {

class SteppingLoop;
struct NodeSettings;

/// Serves ~pause by `pause_handle` and all else by `private_handle`, in the threads of their
/// callbacks, while the result exists. `scene` and `loop` must outlive it; `has_errors` as of
/// toState.
std::vector<ros::ServiceServer> advertiseServices(const Scene& scene, bool has_errors,
                                                  SteppingLoop& loop,
                                                  ros::NodeHandle& private_handle,
                                                  ros::NodeHandle& pause_handle);

/// Serves `real_time_factor` and `publish_rate` while the result exists. Rejects values out of
/// range with a warning and keeps the present ones. The service runs in the thread that serves the
/// callback queue of `handle`, the private one. `follows_clock`: a followed clock sets the pace.
std::shared_ptr<void> serveSettings(const ros::NodeHandle& handle, const NodeSettings& settings,
                                    bool follows_clock, SteppingLoop& loop);

}  // namespace variator_sim
