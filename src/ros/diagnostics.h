/// The simulation's health on /diagnostics (REP 107).
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "ros/health.h"

namespace variator_sim {

/// For one thread, after construction.
class Diagnostics {
 public:
  /// `constraints`: their names, for the residuals.
  Diagnostics(const ros::NodeHandle& public_handle, const ros::NodeHandle& private_handle,
              std::vector<std::string> constraints);

  /// Judges the events since the last call, and publishes the result. The caller calls it once a
  /// second.
  void update(const LoopSnapshot& snapshot);

 private:
  void fill(diagnostic_updater::DiagnosticStatusWrapper& status);

  std::vector<std::string> constraints_;
  LoopSnapshot now_;
  Health health_;
  diagnostic_updater::Updater updater_;
};

}  // namespace variator_sim
