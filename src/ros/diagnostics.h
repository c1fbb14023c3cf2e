/// The simulation's health on /diagnostics (REP 107).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ros/health.h"

namespace ros {
class NodeHandle;
}

namespace variator_sim {

/// For one thread, after construction.
class Diagnostics {
 public:
  /// `constraints`: their names, for the residuals.
  Diagnostics(const ros::NodeHandle& public_handle, const ros::NodeHandle& private_handle,
              std::vector<std::string> constraints);
  ~Diagnostics();

  /// Judges the events since the last call, and publishes the result if /diagnostics has
  /// subscribers. The caller calls it once a second.
  void update(const LoopSnapshot& snapshot, std::uint64_t commands_dropped,
              std::uint64_t samples_dropped);

 private:
  class Publisher;
  std::unique_ptr<Publisher> publisher_;
};

}  // namespace variator_sim
