/// Decides when the next tick may begin. Time is injected, so tests simulate hours at once.
#pragma once

#include <algorithm>
#include <cmath>
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
/// A followed clock moves by steps, so ticks that wait for it are late by its step and not by a
/// fault: the pacer then measures no lateness or overruns, and catches up as much as
/// `kMostBehindFollowed`, since simulated time stays with the clock.
///
/// All methods are for one thread. [loop]
class Pacer {
 public:
  /// Longest wall time caught up in one burst, ns.
  static constexpr std::int64_t kMostBehind = 250000000;
  /// Longest time of a followed clock caught up in one burst, ns.
  static constexpr std::int64_t kMostBehindFollowed = 10000000000;
  /// Longest uninterrupted sleep, ns: the latency of requests at a slow tick rate.
  static constexpr std::int64_t kLongestSleep = 20000000;

  struct Counters {
    std::uint64_t ticks = 0;
    std::uint64_t overruns = 0;  ///< ticks that began more than one period late
    std::int64_t lost_time = 0;  ///< ns by which the deadlines were moved
  };

  /// `period` in ns of the clock, >= 0; 0: unpaced, every tick is due at once. `clock` must outlive
  /// this pacer.
  Pacer(PacingClock& clock, double period)
      : clock_(clock), followed_(clock.isFollowed()), period_(period) {}

  /// Counts deadlines from now, after a pause, a reset or a change of period.
  void anchor() {
    anchor_ = clock_.now();
    tick_ = 0;
  }
  /// Sets a period that counts from now and so causes neither a burst nor a stall. Drops a backlog
  /// of ticks and counts it as lost time.
  void setPeriod(double period) {
    if (isPaced() && !followed_) {
      counters_.lost_time += std::max<std::int64_t>(0, clock_.now() - dueTime(tick_ + 1));
    }
    period_ = period;
    anchor();
  }

  /// Sleeps until the next tick is due, at most about kLongestSleep. True when the tick may begin;
  /// false when it is not due yet: the caller then serves requests and calls again.
  bool waitForTick() {
    std::int64_t now = clock_.now();
    const std::int64_t due = isPaced() ? dueTime(tick_ + 1) : now;
    if (now < due) {
      clock_.sleepUntil(std::min(due, now + kLongestSleep));
      now = clock_.now();
      if (now < due) return false;
    }
    tick_start_ = now;
    tick_due_ = due;
    ++tick_;
    ++counters_.ticks;
    const std::int64_t behind = now - due;
    lateness_ = followed_ ? 0 : behind;
    if (static_cast<double>(lateness_) > period_) ++counters_.overruns;
    if (behind > (followed_ ? kMostBehindFollowed : kMostBehind)) {
      anchor_ += behind;
      counters_.lost_time += behind;
    }
    return true;
  }

  // Only when paced: skipping unneeded ticks.
  /// Returns when tick n is due, ns on the clock.
  std::int64_t dueTime(std::int64_t n) const {
    return anchor_ + std::llround(static_cast<double>(n) * period_);
  }
  /// Returns the last tick due by now; below tick() while the clock stands before the anchor.
  std::int64_t lastDueTick() const {
    const std::int64_t now = clock_.now();
    auto n = static_cast<std::int64_t>(std::floor(static_cast<double>(now - anchor_) / period_));
    // The quotient is rounded, and so are due times.
    while (dueTime(n) > now) --n;
    while (dueTime(n + 1) <= now) ++n;
    return n;
  }
  /// Makes the tick after `n` the next one, n >= tick().
  void passOver(std::int64_t n) {
    tick_ = n;
    tick_due_ = dueTime(n);
  }

  /// Index of the last tick, counted from the anchor.
  std::int64_t tick() const { return tick_; }
  /// Start of the last tick, ns.
  std::int64_t tickStart() const { return tick_start_; }
  /// Due time of the last tick, ns; its start when unpaced.
  std::int64_t tickDue() const { return tick_due_; }
  /// Lateness of the last tick, ns >= 0; 0 when unpaced or on a followed clock.
  std::int64_t lateness() const { return lateness_; }
  const Counters& counters() const { return counters_; }
  bool isPaced() const { return period_ > 0.0; }
  /// True if a followed clock sets the pace.
  bool isFollowed() const { return followed_; }
  /// Period, ns of the clock; 0 when unpaced.
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
