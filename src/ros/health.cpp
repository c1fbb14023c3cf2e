#include "ros/health.h"

#include "model/number_text.h"

namespace variator_sim {
namespace {

/// Returns the increment of a counter that a reset sets to 0.
std::uint64_t added(std::uint64_t now, std::uint64_t before) {
  return now >= before ? now - before : now;
}

}  // namespace

Health judgeHealth(const LoopSnapshot& now, const LoopSnapshot& before) {
  if (now.state == RunState::kStopped) {
    return {HealthLevel::kError, std::string("stopped: ") + toString(now.reason)};
  }
  std::string wrong;
  const auto blame = [&wrong](const std::string& what) {
    wrong += (wrong.empty() ? "" : "; ") + what;
  };
  const auto blameCount = [&blame](std::uint64_t count, const char* what) {
    if (count > 0) blame(std::to_string(count) + what);
  };
  if (now.is_preparing) blame("preparing: the formulas are being compiled");
  if (now.waiting_for_clock) blame("waiting for /clock");
  if (now.pacing.lost_time > before.pacing.lost_time) blame("fell behind its clock for good");
  const std::uint64_t overruns = added(now.pacing.overruns, before.pacing.overruns);
  const std::uint64_t ticks = added(now.pacing.ticks, before.pacing.ticks);
  if (static_cast<double>(overruns) > kManyOverruns * static_cast<double>(ticks)) {
    blame(std::to_string(overruns) + " of " + std::to_string(ticks) + " ticks overran");
  }
  // 0 is not measured yet.
  if (now.real_time_factor > 0.0 && now.real_time_factor < kSlow * now.wanted_factor) {
    blame(
        printed("real-time factor %.3g instead of %.3g", now.real_time_factor, now.wanted_factor));
  }
  const Statistics& counts = now.statistics;
  blameCount(added(counts.commands_refused, before.statistics.commands_refused),
             " commands refused");
  blameCount(added(counts.command_timeouts, before.statistics.command_timeouts),
             " inputs without a command");
  blameCount(added(now.commands_dropped, before.commands_dropped), " commands dropped");
  blameCount(added(now.samples_dropped, before.samples_dropped), " samples dropped");
  if (!wrong.empty()) return {HealthLevel::kWarn, wrong};
  constexpr const char* kNames[] = {"running", "paused", "sleeping: at rest until a command"};
  return {HealthLevel::kOk, kNames[static_cast<std::size_t>(now.state)]};
}

}  // namespace variator_sim
