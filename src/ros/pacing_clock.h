/// The clocks that pace ticks.
#pragma once

#include <sys/prctl.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <limits>

#include "ros/nanoseconds.h"
#include "ros/wakeup.h"

namespace variator_sim {

/// A clock on which threads wait. Times are ns since an epoch of its own. The stepping thread calls
/// these methods; any thread may call `wake`.
class PacingClock {
 public:
  static constexpr std::int64_t kForever = std::numeric_limits<std::int64_t>::max();

  virtual ~PacingClock() = default;
  /// Called once by the thread that paces, before its first sleep.
  virtual void prepareThread() {}
  virtual std::int64_t now() = 0;
  /// Sleeps precisely for the short time before a tick: returns at `deadline` or soon after, at
  /// once when it has passed. May return earlier.
  virtual void sleepUntil(std::int64_t deadline) = 0;
  /// Waits for long (deadline may be kForever); `wake` ends the wait, also if it was called before.
  /// May return earlier.
  virtual void waitUntil(std::int64_t deadline) = 0;
  virtual void wake() = 0;

  /// False until the clock has shown its first time.
  virtual bool hasStarted() { return true; }
  virtual std::uint64_t jumpsBack() { return 0; }
  /// True when another process moves this clock: by steps, at any speed, with pauses.
  virtual bool isFollowed() const { return false; }
  /// Wall time for rates, ns.
  virtual std::int64_t wallTime() { return now(); }
};

/// CLOCK_MONOTONIC. Sleeps by clock_nanosleep to an absolute deadline, with a timer slack of 1 us
/// instead of Linux's 50 us.
class SteadyClock : public PacingClock {
 public:
  void prepareThread() override { prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL); }
  std::int64_t now() override { return steadyTime(); }
  void sleepUntil(std::int64_t deadline) override {
    const timespec time = toTimespec(deadline);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
    }
  }
  void waitUntil(std::int64_t deadline) override { woken_.waitUntil(deadline); }
  void wake() override { woken_.post(); }

 private:
  Semaphore woken_;
};

/// A clock that another thread sets, such as one that receives /clock. Waiting threads wake when
/// the clock reaches their deadline; while the clock is not set, they return every kLongestWait
/// unless they wait forever.
class FollowedClock : public PacingClock {
 public:
  /// One thread calls this. An initial 0 means that there is no time yet. Returns true when the
  /// clock has jumped back.
  bool set(std::int64_t time) {
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

  static constexpr std::int64_t kLongestWait = 100000000;  ///< ns of wall time

  std::int64_t now() override { return time_.load(); }
  void sleepUntil(std::int64_t deadline) override { waitUntil(deadline); }
  void waitUntil(std::int64_t deadline) override {
    awaited_.store(deadline);
    if (time_.load() < deadline) {
      woken_.waitUntil(deadline == kForever ? kForever : steadyTime() + kLongestWait);
    }
    awaited_.store(kForever);
  }
  void wake() override { woken_.post(); }
  bool hasStarted() override { return started_.load(std::memory_order_acquire); }
  std::uint64_t jumpsBack() override { return jumps_back_.load(std::memory_order_acquire); }
  bool isFollowed() const override { return true; }
  std::int64_t wallTime() override { return steadyTime(); }

 private:
  Semaphore woken_;
  // Sequentially consistent: either the setter sees what is waited for, or the waiter sees the time
  // that was set.
  std::atomic<std::int64_t> time_{0};
  std::atomic<std::int64_t> awaited_{kForever};
  std::atomic<std::uint64_t> jumps_back_{0};
  std::atomic<bool> started_{false};
};

}  // namespace variator_sim
