// A service that does nothing.
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

namespace {

bool answer(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
  response.success = true;
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "trigger");
  ros::NodeHandle handle("~");
  const ros::ServiceServer server = handle.advertiseService("trigger", answer);
  ros::spin();
  return 0;
}
