/// The simulation's health on /diagnostics (REP 107).
#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <string>
#include <vector>

#include "ros/health.h"

namespace variator_sim {

/// Returns what judges the events since its last call, and publishes the result; the caller calls
/// it once a second, in one thread. `constraints`: their names, for the residuals.
std::function<void(const LoopSnapshot&)> serveDiagnostics(
    const ros::NodeHandle& public_handle, const ros::NodeHandle& private_handle,
    const std::vector<std::string>& constraints);

}  // namespace variator_sim
