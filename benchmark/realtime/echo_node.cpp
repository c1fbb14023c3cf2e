// Answers each command with a state that holds it, at once: the shortest way there and back.
#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <variator_sim/DrivetrainState.h>

#include <boost/function.hpp>

int main(int argc, char** argv) {
  ros::init(argc, argv, "echo");
  ros::NodeHandle handle("~");
  ros::Publisher publisher = handle.advertise<variator_sim::DrivetrainState>("state", 100);
  variator_sim::DrivetrainState message;
  for (auto* values :
       {&message.angle, &message.velocity, &message.acceleration, &message.applied_torque,
        &message.reaction_torque, &message.reaction_torque_rate}) {
    values->assign(2, 0.0);
  }
  message.residual.assign(1, 0.0);
  message.multiplier.assign(1, 0.0);
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
