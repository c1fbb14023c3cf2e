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
struct Guarded {
  std::mutex mutex;
  std::function<void()> function;
};

}  // namespace

std::shared_ptr<void> runOnPollThread(EventDescriptor& event, std::function<void()> function) {
  const auto guarded = std::make_shared<Guarded>();
  guarded->function = [&event, run = std::move(function)] {
    event.clear();
    run();
  };
  const int descriptor = event.descriptor();
  ros::PollSet& set = ros::PollManager::instance()->getPollSet();
  const bool added = set.addSocket(descriptor, [guarded](int /*events*/) {
    const std::lock_guard<std::mutex> lock(guarded->mutex);
    if (guarded->function) guarded->function();
  });
  if (!added || !set.addEvents(descriptor, EPOLLIN)) {
    throw std::logic_error("roscpp polls this descriptor already");
  }
  return {guarded.get(), [guarded, descriptor](void*) {
            ros::PollManager::instance()->getPollSet().delSocket(descriptor);
            const std::lock_guard<std::mutex> lock(guarded->mutex);
            guarded->function = nullptr;
          }};
}

}  // namespace variator_sim
