/// Work on the thread that serves roscpp's connections.
#pragma once

#include <functional>
#include <memory>

#include "ros/wakeup.h"

namespace variator_sim {

/// Runs a function on roscpp's poll thread after each post of an event. A message published there
/// reaches the sockets before that thread sleeps again; a message from another thread has to wake
/// it first. All connections of the process wait meanwhile, so the function must not block.
class PollThreadTask {
 public:
  /// `event` must outlive this object. Requires an existing ros::NodeHandle.
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
