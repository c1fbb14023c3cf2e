/// Work on the thread that serves roscpp's connections.
#pragma once

#include <functional>
#include <memory>

#include "ros/event_descriptor.h"

namespace variator_sim {

/// Runs a function on roscpp's poll thread after each post of an event. What is published there
/// goes to the sockets before that thread sleeps again; published anywhere else, it has to be woken
/// for that. As all connections of the process wait meanwhile, the function must not block.
class PollThreadTask {
 public:
  /// `event` must outlive this object. To be made after the first ros::NodeHandle.
  PollThreadTask(EventDescriptor& event, std::function<void()> function);
  /// Waits for the end of a call under way.
  ~PollThreadTask();
  PollThreadTask(const PollThreadTask&) = delete;
  PollThreadTask& operator=(const PollThreadTask&) = delete;

 private:
  class Guarded;
  int descriptor_;
  std::shared_ptr<Guarded> guarded_;
};

}  // namespace variator_sim
