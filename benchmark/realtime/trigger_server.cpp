// Services that do nothing: one that says so, and one with the messages of ~step.
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <variator_sim/Step.h>

#include "realtime/two_shafts.h"

namespace {

bool answer(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
  response.success = true;
  return true;
}

bool answerStep(variator_sim::Step::Request& request, variator_sim::Step::Response& response) {
  response.success = true;
  response.state.time = request.duration;
  variator_sim::benchmark::fill(response.state, 1.0);
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
