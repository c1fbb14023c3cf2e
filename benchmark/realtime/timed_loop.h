/// The least that a program needs to do something at a fixed rate.
#pragma once

#include <sys/prctl.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <vector>

namespace variator_sim::benchmark {

/// ns on CLOCK_MONOTONIC.
inline std::int64_t steadyTime() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<std::int64_t>(time.tv_sec) * 1000000000 + time.tv_nsec;
}

/// Prints a row of a probe: round, name, the median and the 99th percentile of times (s).
inline void printRow(int round, const char* name, std::vector<double>& times) {
  std::sort(times.begin(), times.end());
  std::printf("%d %s %.9f %.9f\n", round, name, times[times.size() / 2],
              times[times.size() * 99 / 100]);
  std::fflush(stdout);
}

/// Absolute deadlines, clock_nanosleep, a timer slack of 1 us: what the node asks of the kernel,
/// and nothing else. Made by the thread that loops.
class TimedLoop {
 public:
  explicit TimedLoop(double rate) : period_(static_cast<std::int64_t>(1e9 / rate)) {
    prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
    due_ = steadyTime();
  }

  /// Sleeps until the next deadline. How late it is then, ns.
  std::int64_t wait() {
    due_ += period_;
    std::int64_t now = steadyTime();
    if (now < due_) {
      timespec time{};
      time.tv_sec = static_cast<time_t>(due_ / 1000000000);
      time.tv_nsec = static_cast<long>(due_ % 1000000000);
      while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
      }
      now = steadyTime();
    }
    const std::int64_t lateness = now - due_;
    // The process was stopped: no burst afterwards.
    if (lateness > kMostBehind) due_ = now;
    return lateness;
  }

  std::int64_t period() const { return period_; }

 private:
  static constexpr std::int64_t kMostBehind = 250000000;

  std::int64_t period_;
  std::int64_t due_ = 0;
};

}  // namespace variator_sim::benchmark
