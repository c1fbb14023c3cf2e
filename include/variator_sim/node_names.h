/// What the node keeps for itself of a scene's names: it reads its own parameters from the same
/// tree and publishes beside the scene's topics. For whoever reads scenes that the node reads as
/// well; the core knows none of these names.
#pragma once

#include "variator_sim/scene.h"

namespace variator_sim {

inline NodeNames nodeNames() {
  return {{"tick_rate", "publish_rate", "real_time_factor", "publish_clock", "start_paused",
           "realtime_priority", "lock_memory"},
          {"state", "energy", "scene", "status", "parameter_descriptions", "parameter_updates"}};
}

}  // namespace variator_sim
