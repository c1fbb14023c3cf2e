#include "ros/pacing_clock.h"

#include <sys/prctl.h>

#include <cerrno>

#include "ros/nanoseconds.h"

namespace variator_sim {

void SteadyClock::prepareThread() {
  prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
}

std::int64_t SteadyClock::now() {
  return steadyTime();
}

void SteadyClock::sleepUntil(std::int64_t deadline) {
  const timespec time = toTimespec(deadline);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
  }
}

bool FollowedClock::set(std::int64_t time) {
  const bool started = started_.load(std::memory_order_relaxed);
  if (!started && time == 0) return false;
  const bool jumped_back = started && time < time_.load();
  time_.store(time);
  // A thread that sees the jump also sees the time after it.
  if (jumped_back) jumps_back_.fetch_add(1, std::memory_order_release);
  if (!started) started_.store(true, std::memory_order_release);
  if (jumped_back || !started || time >= awaited_.load()) woken_.post();
  return jumped_back;
}

void FollowedClock::waitUntil(std::int64_t deadline) {
  awaited_.store(deadline);
  if (time_.load() < deadline) {
    woken_.waitUntil(deadline == kForever ? kForever : steadyTime() + kLongestWait);
  }
  awaited_.store(kForever);
}

}  // namespace variator_sim
