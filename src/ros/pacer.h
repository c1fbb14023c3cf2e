/// When the next tick may begin. Time is injected, so tests pass hours in no time.
#pragma once

#include <cstdint>

#include "ros/pacing_clock.h"

namespace variator_sim {

/// Paces ticks by absolute deadlines: tick n after an anchor is due at anchor + n period, so that a
/// late tick does not delay the ones after it.
///
/// Simulated time is never skipped. Ticks that are late follow each other without a sleep until
/// they have caught up; but when they are more than `kMostBehind` behind (a stopped process, a
/// scene too heavy for its rate) the deadlines move by that lateness, which is counted as lost
/// time, instead of a longer burst.
///
/// A clock that is followed moves by steps, so ticks that wait for it are late by its step and not
/// by a fault: there, lateness and overruns are not measured, and up to `kMostBehindFollowed` is
/// caught up, since simulated time is to stay with the clock.
///
/// All methods are for one thread. [loop]
class Pacer {
 public:
  /// Most wall time that is caught up in one burst, ns.
  static constexpr std::int64_t kMostBehind = 250000000;
  /// Most time of a followed clock that is caught up in one burst, ns.
  static constexpr std::int64_t kMostBehindFollowed = 10000000000;
  /// Longest uninterrupted sleep, ns: how soon a request is seen at a slow tick rate.
  static constexpr std::int64_t kLongestSleep = 20000000;

  struct Counters {
    std::uint64_t ticks = 0;
    std::uint64_t overruns = 0;  ///< ticks that began more than one period late
    std::int64_t lost_time = 0;  ///< ns by which the deadlines were moved
  };

  /// `period` in ns of the clock, >= 0; 0: unpaced, every tick is due at once. `clock` must outlive
  /// this pacer.
  Pacer(PacingClock& clock, double period);

  /// Counts deadlines from now: after a pause, a reset, a change of period.
  void anchor();
  /// A new period, counted from now: neither a burst nor a stall comes of it. A backlog of ticks is
  /// forgotten and counted as lost time.
  void setPeriod(double period);

  /// Sleeps until the next tick is due, at most about kLongestSleep. True when the tick may begin;
  /// false when it is not due yet: look for requests and call again.
  bool waitForTick();

  /// @name Only when paced: passing over ticks that nobody needs
  /// @{
  /// When tick n is due, ns on the clock.
  std::int64_t dueTime(std::int64_t n) const;
  /// The last tick that is due by now; below tick() when the clock stands before the anchor.
  std::int64_t lastDueTick() const;
  /// The next tick is the one after `n`, n >= tick().
  void passOver(std::int64_t n);
  /// @}

  /// The last tick: how many there have been since the anchor.
  std::int64_t tick() const { return tick_; }
  /// When the last tick began, ns.
  std::int64_t tickStart() const { return tick_start_; }
  /// When the last tick was due, ns; when it began, when unpaced.
  std::int64_t tickDue() const { return tick_due_; }
  /// How late the last tick began, ns >= 0; 0 when unpaced or on a followed clock.
  std::int64_t lateness() const { return lateness_; }
  const Counters& counters() const { return counters_; }
  bool isPaced() const { return period_ > 0.0; }
  /// Whether somebody else's clock sets the pace.
  bool isFollowed() const { return followed_; }
  /// ns of the clock; 0 when unpaced.
  double period() const { return period_; }

 private:
  PacingClock& clock_;
  bool followed_;
  double period_;
  std::int64_t anchor_ = 0;
  std::int64_t tick_ = 0;
  std::int64_t tick_start_ = 0;
  std::int64_t tick_due_ = 0;
  std::int64_t lateness_ = 0;
  Counters counters_;
};

}  // namespace variator_sim
