/// Scenes for tests, from YAML text or file, with the components this package ships.
#pragma once

#include <string>

#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/node_names.h"
#include "variator_sim/scene.h"
#include "variator_sim/simulation.h"

namespace variator_sim::test {

inline Scene sceneFromText(const std::string& yaml) {
  BuiltinComponentFactory factory;
  return readScene(readYamlText(yaml, "test"), factory, nodeNames());
}

inline Scene sceneFromFile(const std::string& path) {
  BuiltinComponentFactory factory;
  return readScene(readYamlFile(path), factory, nodeNames());
}

/// Both tolerances at once.
inline Scene withTolerance(Scene scene, double tolerance) {
  scene.solver.relative_tolerance = tolerance;
  scene.solver.absolute_tolerance = tolerance;
  return scene;
}

inline Scene withStepper(Scene scene, StepperKind stepper) {
  scene.solver.stepper = stepper;
  return scene;
}

/// Adds an element that takes no keys.
inline void addTorque(Scene& scene, const TorquePtr& torque) {
  const ParameterTree none = ParameterTree::dictionary();
  ParameterReader reader(none, "added");
  ComponentContext context("added", reader, scene.shafts, scene.inputs, scene.symbols, scene.graph);
  torque->configure(context);
  scene.torques.push_back(torque);
}

/// False where `scene` refuses it: `taylor` needs a motion that has series.
inline bool takes(const Scene& scene, StepperKind stepper) {
  if (stepper != StepperKind::kTaylor && stepper != StepperKind::kTaylorFixed) return true;
  try {
    Simulation simulation(withStepper(scene, stepper));
  } catch (const SceneError& error) {
    if (error.keyPath() == "solver/stepper") return false;
  }
  return true;
}

}  // namespace variator_sim::test
