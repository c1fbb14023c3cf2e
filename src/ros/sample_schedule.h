/// Selects the ticks at which samples are taken.
#pragma once

#include <algorithm>
#include <cstdint>

#include "ros/nanoseconds.h"
#include "ros/pacer.h"

namespace variator_sim {

/// Paced, every k-th tick has a sample: publish_rate counts wall time, so the traffic does not grow
/// with the speed. Once the pacer has lost time (the scene overloads the node), a tick also has a
/// sample when the last is twice 1 / publish_rate ago; before that late ticks are caught up, and
/// samples stay at the same simulated times. Unpaced, a tick has one when the last is
/// 1 / publish_rate ago. [loop]
class SampleSchedule {
 public:
  /// `publish_rate` in Hz; `speed`: ticks per s of the clock, 0 when unpaced. The caller then calls
  /// `countFrom`.
  void setRate(double publish_rate, double speed) {
    interval_ = toCount(kNanosecondsPerSecond / publish_rate);
    ticks_per_sample_ = std::max(1.0, speed / publish_rate);
  }

  /// Counts samples from the last tick of `pacer`; it is `now`, ns on the clock.
  void countFrom(const Pacer& pacer, std::int64_t now) {
    base_ = pacer.tick();
    lost_time_ = pacer.counters().lost_time;
    count_ = 0;
    next_tick_ = base_ + toCount(ticks_per_sample_);
    next_time_ = now;
    last_time_ = now;
  }

  /// Returns whether the last tick of `pacer` has a sample. The caller calls it once a tick.
  bool isDue(const Pacer& pacer) {
    if (pacer.isPaced()) {
      const bool is_overdue = pacer.counters().lost_time > lost_time_ && !pacer.isFollowed() &&
                              pacer.tickStart() - last_time_ >= 2 * interval_;
      if (pacer.tick() < next_tick_ && !is_overdue) return false;
      passOver(pacer.tick(), pacer.tickStart());
      return true;
    }
    if (pacer.tickStart() < next_time_) return false;
    next_time_ = std::max(next_time_ + interval_, pacer.tickStart());
    return true;
  }

  /// Next tick with a sample; paced only.
  std::int64_t nextTick() const { return next_tick_; }
  /// Skips the samples up to `tick`, at `now`, ns on the clock; paced only.
  void passOver(std::int64_t tick, std::int64_t now) {
    last_time_ = now;
    while (next_tick_ <= tick) {
      ++count_;
      // Sample m is due at tick round(m ticks_per_sample): no rounding error adds up.
      next_tick_ = base_ + toCount(static_cast<double>(count_ + 1) * ticks_per_sample_);
    }
  }

 private:
  double ticks_per_sample_ = 1.0;
  std::int64_t interval_ = 0;   ///< unpaced, ns
  std::int64_t base_ = 0;       ///< the tick from which samples are counted
  std::int64_t lost_time_ = 0;  ///< of the pacer at that tick, ns
  std::int64_t count_ = 0;      ///< since then
  std::int64_t next_tick_ = 0;  ///< paced only
  std::int64_t next_time_ = 0;  ///< unpaced only, ns on the clock
  std::int64_t last_time_ = 0;  ///< paced only: when the last one was taken, ns on the clock
};

}  // namespace variator_sim
