#include "ros/live_settings.h"

#include <dynamic_reconfigure/server.h>
#include <variator_sim/VariatorSimConfig.h>

#include <string>

#include "ros/checked_lists.h"
#include "ros/stepping_loop.h"

namespace variator_sim {
namespace {

class LiveSettings {
 public:
  LiveSettings(const ros::NodeHandle& handle, const NodeSettings& settings, bool follows_clock,
               SteppingLoop& loop)
      : name_(handle.getNamespace()),
        follows_clock_(follows_clock),
        tick_rate_(settings.tick_rate),
        loop_(loop),
        server_(handle) {
    in_force_.real_time_factor = settings.real_time_factor;
    in_force_.publish_rate = settings.publish_rate;
    // The server calls back at once with its own reading of the parameters; these values replace
    // it.
    server_.setCallback([this](VariatorSimConfig& config, std::uint32_t) {
      if (is_set_up_) {
        change(config);
      } else {
        config.real_time_factor = in_force_.real_time_factor;
        config.publish_rate = in_force_.publish_rate;
        is_set_up_ = true;
      }
    });
  }

 private:
  void change(VariatorSimConfig& config) {
    std::string fault = findFaultOfRealTimeFactor(config.real_time_factor);
    if (fault.empty() && follows_clock_) {
      fault = " is left aside: /use_sim_time is true, so /clock sets the pace";
    }
    change("real_time_factor", fault, "", &VariatorSimConfig::real_time_factor, config,
           &SteppingLoop::setRealTimeFactor);
    change("publish_rate", findFaultOfPublishRate(config.publish_rate, tick_rate_), " Hz",
           &VariatorSimConfig::publish_rate, config, &SteppingLoop::setPublishRate);
    in_force_ = config;
  }

  void change(const char* name, const std::string& fault, const char* unit,
              double VariatorSimConfig::*member, VariatorSimConfig& config,
              void (SteppingLoop::*set)(double)) {
    double& value = config.*member;
    const double in_force = in_force_.*member;
    if (value == in_force) return;
    if (fault.empty()) {
      (loop_.*set)(value);
      return;
    }
    // The generated code has moved values beyond its limits to these.
    const bool is_less = value <= VariatorSimConfig::__getMin__().*member;
    const bool is_more = value >= VariatorSimConfig::__getMax__().*member;
    ROS_WARN("%s: %s %g%s%s; it stays %g%s", name_.c_str(), name, value,
             is_less ? " (or less)" : (is_more ? " (or more)" : ""), fault.c_str(), in_force, unit);
    value = in_force;
  }

  std::string name_;
  bool follows_clock_;
  double tick_rate_;
  SteppingLoop& loop_;
  bool is_set_up_ = false;
  VariatorSimConfig in_force_;
  dynamic_reconfigure::Server<VariatorSimConfig> server_;
};

}  // namespace

std::shared_ptr<void> serveSettings(const ros::NodeHandle& handle, const NodeSettings& settings,
                                    bool follows_clock, SteppingLoop& loop) {
  return std::make_shared<LiveSettings>(handle, settings, follows_clock, loop);
}

}  // namespace variator_sim
