#include "ros/diagnostics.h"

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/console.h>

#include <exception>
#include <memory>

namespace variator_sim {
namespace {

double toMicroseconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds) / 1e3;
}

void fill(const LoopSnapshot& now, const Health& health,
          const std::vector<std::string>& constraints,
          diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.summary(static_cast<unsigned char>(health.level), health.summary);
  status.add("real-time factor", now.real_time_factor);
  status.add("ticks", now.pacing.ticks);
  status.add("overruns", now.pacing.overruns);
  status.add("lateness p50 (us)", toMicroseconds(now.lateness.p50));
  status.add("lateness p99 (us)", toMicroseconds(now.lateness.p99));
  status.add("lateness max (us)", toMicroseconds(now.lateness.max));
  status.add("lost wall time (s)", static_cast<double>(now.pacing.lost_time) / 1e9);
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    status.add("residual of " + constraints[i], now.residual[i]);
  }
  status.add("commands accepted", now.statistics.commands_accepted);
  status.add("commands clamped", now.statistics.commands_clamped);
  status.add("commands refused", now.statistics.commands_refused);
  status.add("commands dropped", now.commands_dropped);
  status.add("command timeouts", now.statistics.command_timeouts);
  status.add("samples dropped", now.samples_dropped);
  status.add("rounding (tolerances)", now.statistics.largest_rounding);
  status.add("energy of the reactions", describe(now.energy_doubt));
  status.add("stop reason", std::string(toString(now.reason)));
}

}  // namespace

std::function<void(const LoopSnapshot&)> serveDiagnostics(
    const ros::NodeHandle& public_handle, const ros::NodeHandle& private_handle,
    const std::vector<std::string>& constraints) {
  const auto now = std::make_shared<LoopSnapshot>();
  const auto health = std::make_shared<Health>();
  const auto updater = std::make_shared<diagnostic_updater::Updater>(public_handle, private_handle,
                                                                     private_handle.getNamespace());
  updater->setHardwareID("none");
  updater->add("simulation", [=](diagnostic_updater::DiagnosticStatusWrapper& status) {
    fill(*now, *health, constraints, status);
  });
  return [=](const LoopSnapshot& snapshot) {
    *health = judgeHealth(snapshot, *now);
    *now = snapshot;
    try {
      updater->force_update();
    } catch (const std::exception& error) {
      // The updater adds its period to the time: in the last second of ROS time there is none left.
      ROS_WARN_ONCE("no diagnostics: %s", error.what());
    }
  };
}

}  // namespace variator_sim
