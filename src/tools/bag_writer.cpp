#include <rosbag/bag.h>
#include <rosbag/exceptions.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <memory>
#include <system_error>

#include "ros/message_conversion.h"
#include "tools/sample_writer.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

ros::Time stampOf(double time) {
  constexpr double kLatestStamp = 4294967295.0;  // s, of an unsigned 32-bit counter
  return toStamp(static_cast<std::int64_t>(std::llround(std::min(time, kLatestStamp) * 1e9)));
}

class BagWriter : public SampleWriter {
 public:
  BagWriter(const std::string& path, const Simulation& simulation, const ColumnGroups& columns)
      : path_(path),
        columns_(columns),
        state_(makeState(simulation.scene(), columns.errors)),
        joint_state_(makeJointState(simulation.scene())) {
    for (const QuantityGroup group : columns_.quantities) {
      quantities_.push_back(makeQuantities(simulation, group));
    }
    guard([&] {
      bag_->open(path, rosbag::bagmode::Write);
      bag_->write("scene", ros::TIME_MIN, toSceneInfo(simulation));
    });
  }
  ~BagWriter() override {
    try {
      if (bag_ != nullptr) BagWriter::close();
    } catch (const OutputError&) {
      // The caller already reports an earlier error.
    }
  }

  void write(const SampleBlock& block) override {
    guard([&] {
      const double* quantities = block.quantities.data();
      for (const Sample& sample : block.samples) {
        writeSample(sample, quantities);
        for (const NamedValues& message : quantities_) quantities += message.value.size();
      }
    });
  }

  void close() override {
    guard([&] { bag_->close(); });
  }

 private:
  void writeSample(const Sample& sample, const double* quantities) {
    const ros::Time stamp = stampOf(sample.time);
    // A bag accepts no entry at time 0; the message's own stamp keeps it.
    const ros::Time filed = std::max(stamp, ros::TIME_MIN);
    if (columns_.state) {
      state_.header.stamp = stamp;
      fillState(sample, sample.time, state_);
      bag_->write("state", filed, state_);
      joint_state_.header.stamp = stamp;
      fillJointState(sample, joint_state_);
      bag_->write("joint_states", filed, joint_state_);
    }
    for (std::size_t i = 0; i < quantities_.size(); ++i) {
      NamedValues& message = quantities_[i];
      message.header.stamp = stamp;
      fillQuantities(quantities, sample.time, message);
      quantities += message.value.size();
      bag_->write(toString(columns_.quantities[i]), filed, message);
    }
    if (columns_.energy) {
      energy_.header.stamp = stamp;
      fillEnergy(sample.energy, sample.time, energy_);
      bag_->write("energy", filed, energy_);
    }
  }

  template <class Action>
  void guard(Action action) {
    errno = 0;
    try {
      action();
    } catch (const rosbag::BagException& error) {
      // rosbag does not report the system's reason.
      const int reason = errno;
      std::string message = path_ + ": " + error.what();
      if (reason != 0) message += " (" + std::generic_category().message(reason) + ")";
      if (abandon()) {
        message += "; it has no index: `rosbag reindex` makes one for what was written before";
      }
      throw OutputError(message);
    }
  }

  /// rosbag closes a bag in its destructor, too, which fails again and ends the program: a bag that
  /// cannot be completed is never destroyed. Returns true when the file has content.
  bool abandon() {
    static rosbag::Bag* abandoned = nullptr;
    abandoned = bag_.release();
    return abandoned->isOpen() && abandoned->getSize() > 0;
  }

  std::string path_;
  ColumnGroups columns_;
  std::unique_ptr<rosbag::Bag> bag_ = std::make_unique<rosbag::Bag>();  ///< none after a failure
  DrivetrainState state_;
  std::vector<NamedValues> quantities_;  ///< of columns_.quantities
  DrivetrainEnergy energy_;
  sensor_msgs::JointState joint_state_;
};

}  // namespace

std::unique_ptr<SampleWriter> makeBagWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns) {
  return std::make_unique<BagWriter>(path, simulation, columns);
}

}  // namespace variator_sim
