// Subscribes to the states of all topics named, and forgets them. Says so once it hears all.
#include <ros/ros.h>
#include <variator_sim/DrivetrainState.h>

#include <boost/function.hpp>
#include <cstdio>
#include <set>
#include <vector>

int main(int argc, char** argv) {
  ros::init(argc, argv, "sink");
  ros::NodeHandle handle;
  std::set<int> heard;
  std::vector<ros::Subscriber> subscribers;
  for (int i = 1; i < argc; ++i) {
    const boost::function<void(const variator_sim::DrivetrainStateConstPtr&)> receive =
        [i, argc, &heard](const variator_sim::DrivetrainStateConstPtr&) {
          if (!heard.insert(i).second || static_cast<int>(heard.size()) < argc - 1) return;
          std::puts("all heard");
          std::fflush(stdout);
        };
    subscribers.push_back(handle.subscribe<variator_sim::DrivetrainState>(argv[i], 1000, receive));
  }
  ros::spin();
  return 0;
}
