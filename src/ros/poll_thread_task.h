/// Work on the thread that serves roscpp's connections.
#pragma once

#include <functional>
#include <memory>

#include "ros/wakeup.h"

namespace variator_sim {

/// Runs a function on roscpp's poll thread after each post of an event, while the result exists,
/// whose end waits for that of a call under way. A message published there reaches the sockets
/// before that thread sleeps again; a message from another thread has to wake it first. All
/// connections of the process wait meanwhile, so the function must not block. `event` must outlive
/// the result. Requires an existing ros::NodeHandle.
std::shared_ptr<void> runOnPollThread(EventDescriptor& event, std::function<void()> function);

}  // namespace variator_sim
