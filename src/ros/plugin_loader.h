/// Loads components from shared libraries of any package by pluginlib.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "variator_sim/scene.h"

namespace variator_sim {

/// Makes the built-in types without a search. It looks up any other type among the plugins that
/// packages export for variator_sim::Constraint and variator_sim::Torque, and only then searches
/// packages. It needs no ROS master. A component keeps its library loaded after this factory is
/// gone. Several threads may use it.
class PluginlibComponentFactory : public ComponentFactory {
 public:
  PluginlibComponentFactory();
  ~PluginlibComponentFactory() override;

  /// Returns nullptr for an unknown type. Throws std::runtime_error, with pluginlib's reason, when
  /// the type is exported but its library cannot be loaded, or when packages cannot be searched at
  /// all.
  ConstraintPtr createConstraint(const std::string& type) override;
  TorquePtr createTorque(const std::string& type) override;
  /// Returns built-in types and those that packages export (searches them).
  std::vector<std::string> constraintTypes() override;
  std::vector<std::string> torqueTypes() override;
  std::shared_ptr<const void> libraries() override;

 private:
  struct Loaders;
  BuiltinComponentFactory builtin_;
  std::shared_ptr<Loaders> loaders_;
};

/// Reads a whole scene with the components of all packages. Throws SceneError.
inline Scene readSceneWithPlugins(const ParameterTree& tree) {
  PluginlibComponentFactory factory;
  return readScene(tree, factory, nodeNames());
}

}  // namespace variator_sim
