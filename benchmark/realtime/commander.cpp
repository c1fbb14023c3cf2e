// Commands at a rate on one topic. At the end of its input: how many there were.
#include <poll.h>
#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "realtime/timed_loop.h"

namespace {

bool isInputAtEnd() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return poll(&input, 1, 0) != 0;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "commander");
  const std::string topic = argc > 1 ? argv[1] : "";
  const double rate = argc > 2 ? std::atof(argv[2]) : 0.0;
  if (topic.empty() || !(rate > 0.0)) {
    std::fprintf(stderr, "usage: commander TOPIC RATE\n");
    return 2;
  }
  ros::NodeHandle handle;
  ros::Publisher publisher = handle.advertise<std_msgs::Float64>(topic, 10000);
  while (ros::ok() && publisher.getNumSubscribers() == 0) ros::WallDuration(0.01).sleep();
  std_msgs::Float64 command;
  variator_sim::benchmark::TimedLoop loop(rate);
  const auto ticks_per_look = static_cast<long>(std::ceil(rate / 10.0));
  long sent = 0;
  while (ros::ok() && (sent % ticks_per_look != 0 || !isInputAtEnd())) {
    loop.wait();
    command.data = 20.0 * std::sin(static_cast<double>(sent) / rate);  // N m, 1 rad/s
    publisher.publish(command);
    ++sent;
  }
  // Messages in the queue are sent first.
  ros::WallDuration(0.5).sleep();
  std::printf("%ld\n", sent);
  return 0;
}
