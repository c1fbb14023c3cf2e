/// The node's services.
#pragma once

#include <ros/ros.h>

#include <vector>

#include "variator_sim/scene.h"

namespace variator_sim {

class SteppingLoop;

/// Serves ~pause by `pause_handle` and all else by `private_handle`, in the threads of their
/// callbacks, while the result exists. `scene` and `loop` must outlive it; `has_errors` as of
/// toState.
std::vector<ros::ServiceServer> advertiseServices(const Scene& scene, bool has_errors,
                                                  SteppingLoop& loop,
                                                  ros::NodeHandle& private_handle,
                                                  ros::NodeHandle& pause_handle);

}  // namespace variator_sim
