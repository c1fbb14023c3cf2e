#include "ros/diagnostics.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/console.h>

#include <exception>
#include <utility>

namespace variator_sim {
namespace {

double toMicroseconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds) / 1e3;
}

unsigned char toLevel(HealthLevel level) {
  using diagnostic_msgs::DiagnosticStatus;
  constexpr unsigned char kLevels[] = {DiagnosticStatus::OK, DiagnosticStatus::WARN,
                                       DiagnosticStatus::ERROR};
  return kLevels[static_cast<std::size_t>(level)];
}

}  // namespace

Diagnostics::Diagnostics(ros::NodeHandle public_handle, const ros::NodeHandle& private_handle,
                         std::vector<std::string> constraints)
    : constraints_(std::move(constraints)),
      // The updater does not report whether it has subscribers.
      listeners_(public_handle.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 1)),
      updater_(public_handle, private_handle, private_handle.getNamespace()) {
  updater_.setHardwareID("none");
  updater_.add("simulation",
               [this](diagnostic_updater::DiagnosticStatusWrapper& status) { fill(status); });
}

void Diagnostics::update(const LoopSnapshot& snapshot, std::uint64_t commands_dropped,
                         std::uint64_t samples_dropped) {
  const HealthCounts before = now_;
  snapshot_ = snapshot;
  now_.ticks = snapshot.pacing.ticks;
  now_.overruns = snapshot.pacing.overruns;
  now_.lost_time = snapshot.pacing.lost_time;
  now_.commands_refused = snapshot.statistics.commands_refused;
  now_.command_timeouts = snapshot.statistics.command_timeouts;
  now_.commands_dropped = commands_dropped;
  now_.samples_dropped = samples_dropped;
  health_ = judgeHealth(snapshot, now_, before);
  if (listeners_.getNumSubscribers() == 0) return;
  try {
    updater_.force_update();
  } catch (const std::exception& error) {
    // The updater adds its period to the time: in the last second of ROS time there is none left.
    ROS_WARN_ONCE("no diagnostics: %s", error.what());
  }
}

void Diagnostics::fill(diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.summary(toLevel(health_.level), health_.summary);
  status.add("real-time factor", snapshot_.real_time_factor);
  status.add("ticks", now_.ticks);
  status.add("overruns", now_.overruns);
  status.add("lateness p50 (us)", toMicroseconds(snapshot_.lateness_p50));
  status.add("lateness p99 (us)", toMicroseconds(snapshot_.lateness_p99));
  status.add("lateness max (us)", toMicroseconds(snapshot_.lateness_max));
  status.add("lost wall time (s)", static_cast<double>(now_.lost_time) / 1e9);
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    status.add("residual of " + constraints_[i], snapshot_.residual[i]);
  }
  status.add("commands accepted", snapshot_.statistics.commands_accepted);
  status.add("commands clamped", snapshot_.statistics.commands_clamped);
  status.add("commands refused", now_.commands_refused);
  status.add("commands dropped", now_.commands_dropped);
  status.add("command timeouts", now_.command_timeouts);
  status.add("samples dropped", now_.samples_dropped);
  status.add("rounding (tolerances)", snapshot_.statistics.largest_rounding);
  status.add("energy of the reactions", describe(snapshot_.energy_doubt));
  status.add("stop reason", std::string(toString(snapshot_.reason)));
}

}  // namespace variator_sim
