/// Waking another thread without a lock.
#pragma once

#include <semaphore.h>

#include <cerrno>
#include <cstdint>

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

  void wait() {
    while (sem_wait(&semaphore_) != 0 && errno == EINTR) {
    }
  }

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

}  // namespace variator_sim
