#include "ros/diagnostics.h"

#include <ros/console.h>

#include <exception>
#include <utility>

namespace variator_sim {
namespace {

double toMicroseconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds) / 1e3;
}

}  // namespace

Diagnostics::Diagnostics(const ros::NodeHandle& public_handle,
                         const ros::NodeHandle& private_handle,
                         std::vector<std::string> constraints)
    : constraints_(std::move(constraints)),
      updater_(public_handle, private_handle, private_handle.getNamespace()) {
  updater_.setHardwareID("none");
  updater_.add("simulation",
               [this](diagnostic_updater::DiagnosticStatusWrapper& status) { fill(status); });
}

void Diagnostics::update(const LoopSnapshot& snapshot) {
  health_ = judgeHealth(snapshot, now_);
  now_ = snapshot;
  try {
    updater_.force_update();
  } catch (const std::exception& error) {
    // The updater adds its period to the time: in the last second of ROS time there is none left.
    ROS_WARN_ONCE("no diagnostics: %s", error.what());
  }
}

void Diagnostics::fill(diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.summary(static_cast<unsigned char>(health_.level), health_.summary);
  status.add("real-time factor", now_.real_time_factor);
  status.add("ticks", now_.pacing.ticks);
  status.add("overruns", now_.pacing.overruns);
  status.add("lateness p50 (us)", toMicroseconds(now_.lateness.p50));
  status.add("lateness p99 (us)", toMicroseconds(now_.lateness.p99));
  status.add("lateness max (us)", toMicroseconds(now_.lateness.max));
  status.add("lost wall time (s)", static_cast<double>(now_.pacing.lost_time) / 1e9);
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    status.add("residual of " + constraints_[i], now_.residual[i]);
  }
  status.add("commands accepted", now_.statistics.commands_accepted);
  status.add("commands clamped", now_.statistics.commands_clamped);
  status.add("commands refused", now_.statistics.commands_refused);
  status.add("commands dropped", now_.commands_dropped);
  status.add("command timeouts", now_.statistics.command_timeouts);
  status.add("samples dropped", now_.samples_dropped);
  status.add("rounding (tolerances)", now_.statistics.largest_rounding);
  status.add("energy of the reactions", describe(now_.energy_doubt));
  status.add("stop reason", std::string(toString(now_.reason)));
}

}  // namespace variator_sim
