/// Settings that dynamic_reconfigure changes while the node runs.
#pragma once

#include <dynamic_reconfigure/server.h>
#include <variator_sim/VariatorSimConfig.h>

#include <string>

#include "ros/checked_lists.h"

namespace variator_sim {

class SteppingLoop;
struct NodeSettings;

/// Serves `real_time_factor` and `publish_rate`. Rejects values out of range with a warning and
/// keeps the present ones. Its service runs in the thread that serves the node handle's callback
/// queue.
class LiveSettings {
 public:
  /// `handle` is the private one. `follows_clock`: a followed clock sets the pace.
  LiveSettings(const ros::NodeHandle& handle, const NodeSettings& settings, bool follows_clock,
               SteppingLoop& loop);

 private:
  void change(VariatorSimConfig& config);
  void change(const char* name, const std::string& fault, const char* unit,
              double VariatorSimConfig::*member, VariatorSimConfig& config,
              void (SteppingLoop::*set)(double));

  std::string name_;
  bool follows_clock_;
  double tick_rate_;
  SteppingLoop& loop_;
  bool is_set_up_ = false;
  VariatorSimConfig in_force_;
  dynamic_reconfigure::Server<VariatorSimConfig> server_;
};

}  // namespace variator_sim
