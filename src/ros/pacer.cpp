#include "ros/pacer.h"

#include <sys/prctl.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <ctime>

namespace variator_sim {

void SteadyClock::prepareThread() {
  prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
}

std::int64_t SteadyClock::now() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<std::int64_t>(time.tv_sec) * 1000000000 + time.tv_nsec;
}

void SteadyClock::sleepUntil(std::int64_t deadline) {
  timespec time{};
  time.tv_sec = static_cast<time_t>(deadline / 1000000000);
  time.tv_nsec = static_cast<long>(deadline % 1000000000);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
  }
}

Pacer::Pacer(PacingClock& clock, double period) : clock_(clock), period_(period) {}

void Pacer::anchor() {
  anchor_ = clock_.now();
  tick_ = 0;
}

void Pacer::setPeriod(double period) {
  period_ = period;
  anchor();
}

std::int64_t Pacer::deadline() const {
  return anchor_ + std::llround(static_cast<double>(tick_ + 1) * period_);
}

bool Pacer::waitForTick() {
  std::int64_t now = clock_.now();
  if (!isPaced()) {
    tick_start_ = now;
    lateness_ = 0;
    ++tick_;
    ++counters_.ticks;
    return true;
  }
  const std::int64_t due = deadline();
  if (now < due) {
    clock_.sleepUntil(std::min(due, now + kLongestSleep));
    now = clock_.now();
    if (now < due) return false;
  }
  tick_start_ = now;
  lateness_ = now - due;
  ++tick_;
  ++counters_.ticks;
  if (static_cast<double>(lateness_) > period_) ++counters_.overruns;
  if (lateness_ > kMostBehind) {
    anchor_ += lateness_;
    counters_.lost_time += lateness_;
  }
  return true;
}

}  // namespace variator_sim
