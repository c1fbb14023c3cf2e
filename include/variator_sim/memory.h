/// The memory of a scene: states that are integrated with the motion, and events that set them and
/// the variables. The values of both are inputs of the scene (InputKind).
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "variator_sim/expression/graph.h"

namespace variator_sim {

/// z' = rate
struct SceneState {
  int input = 0;          ///< index in Scene::inputs
  expression::Node rate;  ///< may read accelerations
  /// A law, an event or the rate of another state reads it: the motion is not at rest while it
  /// changes.
  bool is_read = false;
  bool trims_to_rest = false;  ///< trim looks for states in which its rate is 0
};

/// The instants at which a switching function passes 0, and what is set there.
struct SceneEvent {
  enum class Direction { kFalling = -1, kBoth = 0, kRising = 1 };

  std::string name;
  expression::Node when;
  Direction direction = Direction::kBoth;
  /// Index in Scene::inputs, and the value, which reads all values from before the event.
  std::vector<std::pair<int, expression::Node>> sets;
};

}  // namespace variator_sim
