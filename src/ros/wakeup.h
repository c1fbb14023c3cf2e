/// Waking another thread without a lock.
#pragma once

#include <semaphore.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

#include "ros/nanoseconds.h"

namespace variator_sim {

/// A POSIX semaphore; `post` never blocks.
class Semaphore {
 public:
  Semaphore() { sem_init(&semaphore_, 0, 0); }
  ~Semaphore() { sem_destroy(&semaphore_); }
  Semaphore(const Semaphore&) = delete;
  Semaphore& operator=(const Semaphore&) = delete;

  /// [loop]
  void post() { sem_post(&semaphore_); }

  /// Waits for a post or `deadline`, ns on CLOCK_MONOTONIC. Returns true when posted.
  bool waitUntil(std::int64_t deadline) {
    const timespec time = toTimespec(deadline);
    int result = 0;
    do {
      result = sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &time);
    } while (result != 0 && errno == EINTR);
    return result == 0;
  }

 private:
  sem_t semaphore_;
};

/// An eventfd, for a thread that polls file descriptors: readable from the first `post` on until
/// `clear`. `post` never blocks.
class EventDescriptor {
 public:
  /// Throws std::system_error when the process has no descriptor left.
  EventDescriptor() : descriptor_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  ~EventDescriptor() { close(descriptor_); }
  EventDescriptor(const EventDescriptor&) = delete;
  EventDescriptor& operator=(const EventDescriptor&) = delete;

  int descriptor() const { return descriptor_; }

  /// [loop]
  void post() {
    // Fails only when 2^64 - 2 posts wait to be cleared: then it is readable anyhow.
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = write(descriptor_, &one, sizeof(one));
  }

  void clear() {
    std::uint64_t posts = 0;
    [[maybe_unused]] const ssize_t got = read(descriptor_, &posts, sizeof(posts));
  }

 private:
  int descriptor_;
};

}  // namespace variator_sim
