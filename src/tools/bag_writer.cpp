#include <rosbag/bag.h>
#include <rosbag/exceptions.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <system_error>

#include "ros/message_conversion.h"
#include "ros/nanoseconds.h"
#include "tools/sample_writer.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

class BagWriter : public SampleWriter {
 public:
  BagWriter(const std::string& path, const Simulation& simulation, const ColumnGroups& columns)
      : path_(path), columns_(columns), simulation_(simulation) {
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
      for (const Sample& sample : block.samples) quantities = writeSample(sample, quantities);
    });
  }

  void close() override {
    guard([&] { bag_->close(); });
  }

 private:
  /// Returns the place behind the sample's quantities.
  const double* writeSample(const Sample& sample, const double* quantities) {
    const Scene& scene = simulation_.scene();
    const double time = sample.time;
    const auto file = [this, stamp = toStamp(toCount(time * kNanosecondsPerSecond))](
                          const char* topic, auto message) {
      message.header.stamp = stamp;
      // A bag accepts no entry at time 0; the message's own stamp keeps it.
      bag_->write(topic, std::max(stamp, ros::TIME_MIN), message);
    };
    if (columns_.state) {
      file("state", toState(sample, time, scene, columns_.errors));
      file("joint_states", toJointState(sample, scene));
    }
    for (const QuantityGroup group : columns_.quantities) {
      const std::vector<std::string>& names = simulation_.quantityNames(group);
      file(toString(group), toMessage(quantities, time, names));
      quantities += names.size();
    }
    if (columns_.energy) file("energy", toMessage(sample.energy, time));
    return quantities;
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
  const Simulation& simulation_;
  std::unique_ptr<rosbag::Bag> bag_ = std::make_unique<rosbag::Bag>();  ///< none after a failure
};

}  // namespace

std::unique_ptr<SampleWriter> makeBagWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns) {
  return std::make_unique<BagWriter>(path, simulation, columns);
}

}  // namespace variator_sim
