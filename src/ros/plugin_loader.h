/// Loads components from shared libraries of any package by pluginlib.
#pragma once

#include <memory>

#include "variator_sim/scene.h"

namespace variator_sim {

/// Returns a factory that makes the built-in types without a search. It looks up any other type
/// among the plugins that packages export for variator_sim::Constraint and variator_sim::Torque,
/// and only then searches packages: also when it lists all types. It needs no ROS master. It throws
/// std::runtime_error, with pluginlib's reason, when a type is exported but its library cannot be
/// loaded, or when packages cannot be searched at all. A component keeps its library loaded after
/// the factory is gone. Several threads may use it.
std::shared_ptr<ComponentFactory> makePluginFactory();

/// Reads a whole scene with the components of all packages. Throws SceneError.
inline Scene readSceneWithPlugins(const ParameterTree& tree) {
  return readScene(tree, *makePluginFactory(), nodeNames());
}

}  // namespace variator_sim
