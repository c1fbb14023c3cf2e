/// The node's services.
#pragma once

#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/GetState.h>

#include <string>
#include <vector>

#include "ros/checked_lists.h"
#include "ros/loop_messages.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

class SteppingLoop;

/// Services that run in the thread of the handles' callbacks.
class Services {
 public:
  /// `loop` must outlive this.
  Services(const Simulation& simulation, SteppingLoop& loop);
  /// `pause_handle` serves ~pause, `private_handle` all else.
  void advertise(ros::NodeHandle& private_handle, ros::NodeHandle& pause_handle);

 private:
  template <class Service, class Answer>
  void add(ros::NodeHandle& handle, const char* name, Answer answer);

  /// Return why a request is rejected, or "". They check all of it before any change.
  std::string read(const Step::Request& message, LoopRequest& request) const;
  std::string read(const SetState::Request& message, StateExchange& exchange) const;
  /// Fills in success, message and state of an answer.
  template <class Response>
  void fill(const LoopAnswer& answer, Response& response);

  const Scene scene_;  // for its names: a copy
  SteppingLoop& loop_;
  DrivetrainState state_message_;
  std::vector<ros::ServiceServer> servers_;
};

}  // namespace variator_sim
