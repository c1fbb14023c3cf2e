/// Time in whole nanoseconds.
#pragma once

#include <cmath>
#include <cstdint>
#include <ctime>
#include <limits>

namespace variator_sim {

constexpr double kNanosecondsPerSecond = 1e9;
/// The last second that a stamp of ROS holds, 136 years: less than half of what 64 bits do.
constexpr std::int64_t kLastInstant =
    std::int64_t{std::numeric_limits<std::uint32_t>::max()} * 1000000000;
static_assert(kLastInstant < std::numeric_limits<std::int64_t>::max() / 2);

/// Returns the double nearest to ns * 1e-9: both operands are exact, so only the division rounds.
inline double toSeconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds) / kNanosecondsPerSecond;
}

/// Returns the time of CLOCK_MONOTONIC, ns.
inline std::int64_t steadyTime() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<std::int64_t>(time.tv_sec) * 1000000000 + time.tv_nsec;
}

inline timespec toTimespec(std::int64_t nanoseconds) {
  return {static_cast<time_t>(nanoseconds / 1000000000),
          static_cast<long>(nanoseconds % 1000000000)};
}

/// Returns the nearest integer, at most kLastInstant: sums of two results still fit.
inline std::int64_t toCount(double value) {
  return value < static_cast<double>(kLastInstant) ? std::llround(value) : kLastInstant;
}

}  // namespace variator_sim
