/// When the next tick may begin. Time is injected, so tests pass hours in no time.
#pragma once

#include <cstdint>

namespace variator_sim {

/// A clock that never jumps, and sleeping on it. Times are ns since an arbitrary instant.
class PacingClock {
 public:
  virtual ~PacingClock() = default;
  /// Called once by the thread that paces, before its first sleep.
  virtual void prepareThread() {}
  virtual std::int64_t now() = 0;
  /// Returns at or after `deadline`; at once when it has passed.
  virtual void sleepUntil(std::int64_t deadline) = 0;
};

/// CLOCK_MONOTONIC. Sleeps by clock_nanosleep to an absolute deadline, with a timer slack of 1 us
/// instead of Linux's 50 us.
class SteadyClock : public PacingClock {
 public:
  void prepareThread() override;
  std::int64_t now() override;
  void sleepUntil(std::int64_t deadline) override;
};

/// Paces ticks by absolute deadlines: tick n after an anchor is due at anchor + n period, so that a
/// late tick does not delay the ones after it.
///
/// Simulated time is never skipped. Ticks that are late follow each other without a sleep until
/// they have caught up; but when they are more than `kMostBehind` behind (a stopped process, a
/// scene too heavy for its rate) the deadlines move by that lateness, which is counted as lost
/// wall time, instead of a longer burst.
///
/// All methods are for one thread. [loop]
class Pacer {
 public:
  /// Most wall time that is caught up in one burst, ns.
  static constexpr std::int64_t kMostBehind = 250000000;
  /// Longest uninterrupted sleep, ns: how soon a request is seen at a slow tick rate.
  static constexpr std::int64_t kLongestSleep = 20000000;

  struct Counters {
    std::uint64_t ticks = 0;
    std::uint64_t overruns = 0;  ///< ticks that began more than one period late
    std::int64_t lost_time = 0;  ///< ns by which the deadlines were moved
  };

  /// `period` in ns of wall time, >= 0; 0: unpaced, every tick is due at once. `clock` must outlive
  /// this pacer.
  Pacer(PacingClock& clock, double period);

  /// Counts deadlines from now: after a pause, a reset, a change of period.
  void anchor();
  /// A new period, counted from now: neither a burst nor a stall comes of it.
  void setPeriod(double period);

  /// Sleeps until the next tick is due, at most about kLongestSleep. True when the tick may begin;
  /// false when it is not due yet: look for requests and call again.
  bool waitForTick();

  /// When the last tick began, ns.
  std::int64_t tickStart() const { return tick_start_; }
  /// How late the last tick began, ns >= 0; 0 when unpaced.
  std::int64_t lateness() const { return lateness_; }
  const Counters& counters() const { return counters_; }
  bool isPaced() const { return period_ > 0.0; }

 private:
  std::int64_t deadline() const;

  PacingClock& clock_;
  double period_;
  std::int64_t anchor_ = 0;
  std::int64_t tick_ = 0;  ///< ticks since the anchor
  std::int64_t tick_start_ = 0;
  std::int64_t lateness_ = 0;
  Counters counters_;
};

}  // namespace variator_sim
