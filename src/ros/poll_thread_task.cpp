#include "ros/poll_thread_task.h"

#include <ros/poll_manager.h>
#include <sys/epoll.h>

#include <mutex>
#include <stdexcept>
#include <utility>

namespace variator_sim {
namespace {

/// roscpp copies the callback before it runs it, so that it may run after the descriptor has been
/// taken from the set: the copies share this object, which knows whether the function may still be
/// called.
class Guarded {
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

}  // namespace

std::shared_ptr<void> runOnPollThread(EventDescriptor& event, std::function<void()> function) {
  const auto guarded = std::make_shared<Guarded>(event, std::move(function));
  const int descriptor = event.descriptor();
  ros::PollSet& set = ros::PollManager::instance()->getPollSet();
  const bool added = set.addSocket(descriptor, [guarded](int /*events*/) { guarded->run(); });
  if (!added || !set.addEvents(descriptor, EPOLLIN)) {
    throw std::logic_error("roscpp polls this descriptor already");
  }
  return {guarded.get(), [guarded, descriptor](void*) {
            ros::PollManager::instance()->getPollSet().delSocket(descriptor);
            guarded->end();
          }};
}

}  // namespace variator_sim
