#include <rosbag/bag.h>
#include <rosbag/exceptions.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "ros/message_conversion.h"
#include "tools/sample_writer.h"

namespace variator_sim {
namespace {

ros::Time stampOf(double time) {
  constexpr double kLatestStamp = 4294967295.0;  // s, of an unsigned 32-bit counter
  return toStamp(static_cast<std::int64_t>(std::llround(std::min(time, kLatestStamp) * 1e9)));
}

class BagWriter : public SampleWriter {
 public:
  BagWriter(const std::string& path, const Simulation& simulation) try : path_(path) {
    bag_.open(path, rosbag::bagmode::Write);
    prepareState(simulation.scene(), state_);
    prepareJointState(simulation.scene(), joint_state_);
    bag_.write("scene", ros::TIME_MIN, toSceneInfo(simulation));
  } catch (const rosbag::BagException& error) {
    throw OutputError(path + ": " + error.what());
  }

  void write(const std::vector<Sample>& samples) override {
    guard([&] {
      for (const Sample& sample : samples) writeSample(sample);
    });
  }

  void close() override {
    guard([&] { bag_.close(); });
  }

 private:
  void writeSample(const Sample& sample) {
    const ros::Time stamp = stampOf(sample.time);
    // A bag files nothing under time 0; the message's own stamp keeps it.
    const ros::Time filed = std::max(stamp, ros::TIME_MIN);
    state_.header.stamp = stamp;
    fillState(sample, sample.time, state_);
    bag_.write("state", filed, state_);
    joint_state_.header.stamp = stamp;
    fillJointState(sample, joint_state_);
    bag_.write("joint_states", filed, joint_state_);
  }

  template <class Action>
  void guard(Action action) {
    try {
      action();
    } catch (const rosbag::BagException& error) {
      throw OutputError(path_ + ": " + error.what());
    }
  }

  std::string path_;
  rosbag::Bag bag_;
  DrivetrainState state_;
  sensor_msgs::JointState joint_state_;
};

}  // namespace

std::unique_ptr<SampleWriter> makeBagWriter(const std::string& path, const Simulation& simulation) {
  return std::make_unique<BagWriter>(path, simulation);
}

}  // namespace variator_sim
