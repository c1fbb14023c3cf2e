#include "ros/diagnostics.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/console.h>
#include <ros/node_handle.h>

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

class Diagnostics::Publisher {
 public:
  Publisher(ros::NodeHandle public_handle, const ros::NodeHandle& private_handle,
            std::vector<std::string> constraints)
      : constraints_(std::move(constraints)),
        // The updater does not report whether it has subscribers.
        listeners_(public_handle.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 1)),
        updater_(public_handle, private_handle, private_handle.getNamespace()) {
    updater_.setHardwareID("none");
    updater_.add("simulation",
                 [this](diagnostic_updater::DiagnosticStatusWrapper& status) { fill(status); });
  }

  void update(const LoopSnapshot& snapshot, const HealthCounts& now) {
    snapshot_ = snapshot;
    now_ = now;
    health_ = judgeHealth(snapshot, now, before_);
    before_ = now;
    if (listeners_.getNumSubscribers() == 0) return;
    try {
      updater_.force_update();
    } catch (const std::exception& error) {
      // The updater adds its period to the time: in the last second of ROS time there is none left.
      ROS_WARN_ONCE("no diagnostics: %s", error.what());
    }
  }

 private:
  void fill(diagnostic_updater::DiagnosticStatusWrapper& status) {
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

  std::vector<std::string> constraints_;
  LoopSnapshot snapshot_;
  HealthCounts now_;
  HealthCounts before_;
  Health health_;
  ros::Publisher listeners_;
  diagnostic_updater::Updater updater_;
};

Diagnostics::Diagnostics(const ros::NodeHandle& public_handle,
                         const ros::NodeHandle& private_handle,
                         std::vector<std::string> constraints)
    : publisher_(
          std::make_unique<Publisher>(public_handle, private_handle, std::move(constraints))) {}
Diagnostics::~Diagnostics() = default;

void Diagnostics::update(const LoopSnapshot& snapshot, std::uint64_t commands_dropped,
                         std::uint64_t samples_dropped) {
  HealthCounts now;
  now.ticks = snapshot.pacing.ticks;
  now.overruns = snapshot.pacing.overruns;
  now.lost_time = snapshot.pacing.lost_time;
  now.commands_refused = snapshot.statistics.commands_refused;
  now.command_timeouts = snapshot.statistics.command_timeouts;
  now.commands_dropped = commands_dropped;
  now.samples_dropped = samples_dropped;
  publisher_->update(snapshot, now);
}

}  // namespace variator_sim
