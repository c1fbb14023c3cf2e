// From a command to the first state that shows it: commands to several nodes in turn, at random
// instants. Prints, for each round and node, the median and the 99th percentile (s).
#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <variator_sim/DrivetrainState.h>

#include <boost/function.hpp>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "realtime/timed_loop.h"

namespace {

using variator_sim::benchmark::steadyTime;

class Peer {
 public:
  Peer(ros::NodeHandle& handle, std::string name) : name_(std::move(name)) {
    publisher_ = handle.advertise<std_msgs::Float64>(name_ + "/drive_torque", 100);
    const boost::function<void(const variator_sim::DrivetrainStateConstPtr&)> receive =
        [this](const variator_sim::DrivetrainStateConstPtr& state) { look(*state); };
    subscriber_ = handle.subscribe<variator_sim::DrivetrainState>(
        name_ + "/state", 1000, receive, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
  }

  bool isConnected() const {
    return publisher_.getNumSubscribers() > 0 && subscriber_.getNumPublishers() > 0;
  }

  /// s, or a negative number when nothing came for long.
  double measure(double torque) {
    std_msgs::Float64 command;
    command.data = torque;
    std::unique_lock<std::mutex> lock(mutex_);
    wanted_ = torque;
    shown_at_ = 0;
    const std::int64_t begin = steadyTime();
    lock.unlock();
    publisher_.publish(command);
    lock.lock();
    if (!shown_.wait_for(lock, std::chrono::seconds(5), [this] { return shown_at_ != 0; })) {
      return -1.0;
    }
    return static_cast<double>(shown_at_ - begin) / 1e9;
  }

  const std::string& name() const { return name_; }

 private:
  void look(const variator_sim::DrivetrainState& state) {
    const std::int64_t now = steadyTime();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (shown_at_ != 0 || state.applied_torque[0] != wanted_) return;
    shown_at_ = now;
    shown_.notify_one();
  }

  std::string name_;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
  std::mutex mutex_;
  std::condition_variable shown_;
  double wanted_ = 0.0;
  std::int64_t shown_at_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "latency_probe");
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 0;
  const int commands = argc > 2 ? std::atoi(argv[2]) : 0;
  if (rounds < 1 || commands < 1 || argc < 4) {
    std::fprintf(stderr, "usage: latency_probe ROUNDS COMMANDS_PER_ROUND NODE ...\n");
    return 2;
  }
  ros::NodeHandle handle;
  std::vector<std::unique_ptr<Peer>> peers;
  for (int i = 3; i < argc; ++i) peers.push_back(std::make_unique<Peer>(handle, argv[i]));
  ros::AsyncSpinner spinner(1);
  spinner.start();
  for (const auto& peer : peers) {
    while (ros::ok() && !peer->isConnected()) ros::WallDuration(0.01).sleep();
  }
  ros::WallDuration(0.5).sleep();

  std::mt19937 random(1);
  std::uniform_int_distribution<int> pause(2000, 6000);  // us, several ticks
  int count = 0;
  for (int round = 0; round < rounds; ++round) {
    std::vector<std::vector<double>> latencies(peers.size());
    for (int i = 0; i < commands; ++i) {
      // Another torque each time, within 5 N m.
      ++count;
      const double torque = (count % 2 == 0 ? 1.0 : -1.0) * (1.0 + 4e-6 * count);
      for (std::size_t k = 0; k < peers.size(); ++k) {
        std::this_thread::sleep_for(std::chrono::microseconds(pause(random)));
        const double latency = peers[k]->measure(torque);
        if (latency < 0.0) {
          std::fprintf(stderr, "latency_probe: %s did not show a command\n",
                       peers[k]->name().c_str());
          return 1;
        }
        latencies[k].push_back(latency);
      }
    }
    for (std::size_t k = 0; k < peers.size(); ++k) {
      variator_sim::benchmark::printRow(round, peers[k]->name().c_str(), latencies[k]);
    }
  }
  return 0;
}
