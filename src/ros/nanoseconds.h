/// Simulated time in whole nanoseconds.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace variator_sim {

constexpr double kNanosecondsPerSecond = 1e9;
/// The last second that a stamp of ROS holds, 136 years: less than half of what 64 bits do.
constexpr std::int64_t kLastInstant =
    std::int64_t{std::numeric_limits<std::uint32_t>::max()} * 1000000000;
static_assert(kLastInstant < std::numeric_limits<std::int64_t>::max() / 2);

/// The double nearest to ns * 1e-9: both operands are exact, one rounding by the division.
inline double toSeconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds) / kNanosecondsPerSecond;
}

/// The nearest integer, at most kLastInstant: sums of two of them still fit.
inline std::int64_t toCount(double value) {
  return value < static_cast<double>(kLastInstant) ? std::llround(value) : kLastInstant;
}

}  // namespace variator_sim
