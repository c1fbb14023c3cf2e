// A minimal publisher of one message at a rate: a timed loop that fills and publishes it. Without a
// publish rate the loop only turns, in a process that has called ros::init.
#include <ros/ros.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "realtime/timed_loop.h"
#include "realtime/two_shafts.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "bare");
  const double rate = argc > 1 ? std::atof(argv[1]) : 0.0;
  const double publish_rate = argc > 2 ? std::atof(argv[2]) : 0.0;
  if (!(rate > 0.0) || publish_rate < 0.0) {
    std::fprintf(stderr, "usage: bare_publisher RATE [PUBLISH_RATE]\n");
    return 2;
  }
  ros::NodeHandle handle("~");
  ros::Publisher publisher;
  variator_sim::DrivetrainState message;
  if (publish_rate > 0.0) {
    publisher = handle.advertise<variator_sim::DrivetrainState>("state", 100);
    variator_sim::benchmark::fill(message, 0.0);
  }
  const long ticks_per_message = publish_rate > 0.0 ? std::lround(rate / publish_rate) : 0;
  variator_sim::benchmark::TimedLoop loop(rate);
  for (long tick = 1; ros::ok(); ++tick) {
    loop.wait();
    if (ticks_per_message == 0 || tick % ticks_per_message != 0) continue;
    message.header.stamp = ros::Time::now();
    message.time = static_cast<double>(tick) / rate;
    message.angle[0] = message.time;
    publisher.publish(message);
  }
  return 0;
}
