// Answers each command with a state that holds it, at once: the shortest way there and back.
#include <ros/ros.h>
#include <std_msgs/Float64.h>

#include <boost/function.hpp>

#include "realtime/two_shafts.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "echo");
  ros::NodeHandle handle("~");
  ros::Publisher publisher = handle.advertise<variator_sim::DrivetrainState>("state", 100);
  variator_sim::DrivetrainState message;
  variator_sim::benchmark::fill(message, 0.0);
  const boost::function<void(const std_msgs::Float64ConstPtr&)> answer =
      [&](const std_msgs::Float64ConstPtr& command) {
        message.header.stamp = ros::Time::now();
        message.applied_torque[0] = command->data;
        publisher.publish(message);
      };
  const ros::Subscriber subscriber = handle.subscribe<std_msgs::Float64>(
      "drive_torque", 1000, answer, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
  ros::spin();
  return 0;
}
