#include "ros/poll_thread_task.h"

#include <ros/poll_manager.h>
#include <sys/epoll.h>

#include <mutex>
#include <stdexcept>
#include <utility>

namespace variator_sim {

/// roscpp copies the callback before it runs it, so that it may run after the descriptor has been
/// taken from the set: the copies share this object, which knows whether the function may still be
/// called.
class PollThreadTask::Guarded {
 public:
  Guarded(EventDescriptor& event, std::function<void()> function)
      : event_(event), function_(std::move(function)) {}

  void run() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!function_) return;
    event_.clear();
    function_();
  }

  void end() {
    const std::lock_guard<std::mutex> lock(mutex_);
    function_ = nullptr;
  }

 private:
  std::mutex mutex_;
  EventDescriptor& event_;
  std::function<void()> function_;
};

PollThreadTask::PollThreadTask(EventDescriptor& event, std::function<void()> function)
    : descriptor_(event.descriptor()),
      guarded_(std::make_shared<Guarded>(event, std::move(function))) {
  ros::PollSet& set = ros::PollManager::instance()->getPollSet();
  const bool added =
      set.addSocket(descriptor_, [guarded = guarded_](int /*events*/) { guarded->run(); });
  if (!added || !set.addEvents(descriptor_, EPOLLIN)) {
    throw std::logic_error("roscpp polls this descriptor already");
  }
}

PollThreadTask::~PollThreadTask() {
  ros::PollManager::instance()->getPollSet().delSocket(descriptor_);
  guarded_->end();
}

}  // namespace variator_sim
