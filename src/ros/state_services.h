/// ~get_state and ~set_state.
#pragma once

#include <ros/ros.h>
#include <variator_sim/GetState.h>

#include <string>

#include "ros/checked_lists.h"
#include "ros/loop_messages.h"
#include "variator_sim/scene.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

class SteppingLoop;

/// Served where the handle's callbacks are.
class StateServices {
 public:
  /// `loop` must outlive this.
  StateServices(const Simulation& simulation, SteppingLoop& loop);
  void advertise(ros::NodeHandle& private_handle);

 private:
  void answer(GetState::Response& response);
  void answer(const SetState::Request& request, SetState::Response& response);
  /// Why the request is refused, or "".
  std::string read(const SetState::Request& message, StateExchange& exchange) const;
  /// Success, message and state of an answer.
  template <class Response>
  void fill(const LoopAnswer& answer, Response& response);

  const Scene scene_;  // for its names: a copy
  SteppingLoop& loop_;
  DrivetrainState state_message_;
  ros::ServiceServer get_;
  ros::ServiceServer set_;
};

}  // namespace variator_sim
