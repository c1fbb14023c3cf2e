/// The rule behind a simulation's diagnostics. It does not depend on ROS.
#pragma once

#include <cstdint>
#include <string>

#include "ros/loop_messages.h"

namespace variator_sim {

/// Numbered as in diagnostic_msgs/DiagnosticStatus.
enum class HealthLevel : std::uint8_t { kOk, kWarn, kError };

struct Health {
  HealthLevel level = HealthLevel::kOk;
  std::string summary;  ///< what is wrong, or the state
};

/// Largest healthy fraction of overruns among the ticks.
constexpr double kManyOverruns = 0.01;
/// Smallest healthy ratio of measured to wanted real-time factor.
constexpr double kSlow = 0.9;

/// ERROR: the motion has stopped. WARN: since `before` commands were refused, dropped or overdue,
/// samples were dropped, deadlines were moved, or more than kManyOverruns of the ticks were
/// overruns; or the real-time factor is below kSlow of the one wanted; or /clock, or the compiler,
/// is waited for. OK: everything else, a pause and a sleep included.
Health judgeHealth(const LoopSnapshot& now, const LoopSnapshot& before);

}  // namespace variator_sim
