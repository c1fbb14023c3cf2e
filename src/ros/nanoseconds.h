/// Simulated time in whole nanoseconds.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace variator_sim {

constexpr double kNanosecondsPerSecond = 1e9;
/// Half of what 64 bits hold: 146 years.
constexpr std::int64_t kLastInstant = std::numeric_limits<std::int64_t>::max() / 2;

/// The double nearest to ns * 1e-9: both operands are exact, one rounding by the division.
inline double toSeconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds) / kNanosecondsPerSecond;
}

/// The nearest integer, at most kLastInstant: sums of two of them still fit.
inline std::int64_t toCount(double value) {
  return value < static_cast<double>(kLastInstant) ? std::llround(value) : kLastInstant;
}

}  // namespace variator_sim
