/// The node's own parameters, beside the scene.
#pragma once

#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Settings that are complete and valid once read.
struct NodeSettings {
  double tick_rate = 1000.0;      ///< ticks per simulated s
  double publish_rate = 100.0;    ///< states per wall s, from 0.001 to tick_rate
  double real_time_factor = 1.0;  ///< simulated s per wall s; 0: as fast as possible
  bool publish_clock = false;     ///< own /clock: publish simulated time on it
  bool start_paused = false;
  int realtime_priority = 0;    ///< SCHED_FIFO priority of the stepping thread, 0: off
  bool lock_memory = false;     ///< keep the process in memory
  bool estimate_error = false;  ///< states carry estimates of their own global errors
};

/// Returns why a real-time factor is invalid, as the end of a sentence about it, or "".
std::string findFaultOfRealTimeFactor(double factor);
/// Does the same for a publish rate (Hz) at a tick rate (Hz).
std::string findFaultOfPublishRate(double rate, double tick_rate);

/// Reads the settings from the scene's tree; nodeNames() lists all keys. Throws SceneError.
NodeSettings readNodeSettings(const ParameterTree& tree);

}  // namespace variator_sim
