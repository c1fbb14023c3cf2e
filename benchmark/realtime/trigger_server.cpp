// Services that do nothing: one that says so, and one with the messages of ~step.
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/Step.h>

namespace {

bool answer(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
  response.success = true;
  return true;
}

/// As many numbers as a step of two shafts and one constraint returns.
bool answerStep(variator_sim::Step::Request& request, variator_sim::Step::Response& response) {
  response.success = true;
  variator_sim::DrivetrainState& state = response.state;
  state.time = request.duration;
  for (auto* values : {&state.angle, &state.velocity, &state.acceleration, &state.applied_torque,
                       &state.reaction_torque, &state.reaction_torque_rate}) {
    values->assign(2, 1.0);
  }
  state.residual.assign(1, 1.0);
  state.multiplier.assign(1, 1.0);
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "trigger");
  ros::NodeHandle handle("~");
  const ros::ServiceServer trigger = handle.advertiseService("trigger", answer);
  const ros::ServiceServer step = handle.advertiseService("step", answerStep);
  ros::spin();
  return 0;
}
