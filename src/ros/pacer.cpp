#include "ros/pacer.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

Pacer::Pacer(PacingClock& clock, double period)
    : clock_(clock), followed_(clock.isFollowed()), period_(period) {}

void Pacer::anchor() {
  anchor_ = clock_.now();
  tick_ = 0;
}

void Pacer::setPeriod(double period) {
  if (isPaced() && !followed_) {
    counters_.lost_time += std::max<std::int64_t>(0, clock_.now() - dueTime(tick_ + 1));
  }
  period_ = period;
  anchor();
}

std::int64_t Pacer::dueTime(std::int64_t n) const {
  return anchor_ + std::llround(static_cast<double>(n) * period_);
}

std::int64_t Pacer::lastDueTick() const {
  const std::int64_t now = clock_.now();
  auto n = static_cast<std::int64_t>(std::floor(static_cast<double>(now - anchor_) / period_));
  // The quotient is rounded, and so are due times.
  while (dueTime(n) > now) --n;
  while (dueTime(n + 1) <= now) ++n;
  return n;
}

void Pacer::passOver(std::int64_t n) {
  tick_ = n;
  tick_due_ = dueTime(n);
}

bool Pacer::waitForTick() {
  std::int64_t now = clock_.now();
  if (!isPaced()) {
    tick_start_ = now;
    tick_due_ = now;
    lateness_ = 0;
    ++tick_;
    ++counters_.ticks;
    return true;
  }
  const std::int64_t due = dueTime(tick_ + 1);
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
  if (!followed_) {
    lateness_ = behind;
    if (static_cast<double>(behind) > period_) ++counters_.overruns;
  }
  if (behind > (followed_ ? kMostBehindFollowed : kMostBehind)) {
    anchor_ += behind;
    counters_.lost_time += behind;
  }
  return true;
}

}  // namespace variator_sim
