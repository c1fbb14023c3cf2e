/// Scenes for tests, from lines, YAML text or file, with the components this package ships; and the
/// headers that nearly every test needs.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/component_factory.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/node_names.h"
#include "variator_sim/scene.h"
#include "variator_sim/simulation.h"

namespace variator_sim::test {

/// A number in full precision.
inline std::string plainly(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  return buffer;
}

/// A list of them in YAML.
inline std::string list(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "[" : ", ") + plainly(value);
  return text + "]";
}

inline Scene sceneFromText(const std::string& yaml) {
  BuiltinComponentFactory factory;
  return readScene(readYamlText(yaml, "test"), factory, nodeNames());
}

/// The keys of an element's line; sets `is_constraint`.
///   NAME on SHAFT: FORMULA               a torque by formula
///   NAME on SHAFT from TOPIC, KEYS       a commanded torque
///   NAME: FORMULA, NAME of order N: ...  a constraint by formula, of order 2 if none is given
///   NAME = TYPE, KEYS                    a law of this package
inline std::string elementKeys(const std::string& line, bool* is_constraint) {
  std::string name;
  std::string word;
  std::istringstream words(line);
  words >> name >> word;
  const auto rest_behind = [&line](const std::string& text) {
    return line.substr(line.find(text) + text.size());
  };
  *is_constraint = false;
  if (word == "=") {
    const std::string keys = rest_behind(" = ");
    const std::string type = "variator_sim/" + keys.substr(0, keys.find(','));
    const std::vector<std::string> types = BuiltinComponentFactory().constraintTypes();
    *is_constraint = std::find(types.begin(), types.end(), type) != types.end();
    return "type: variator_sim/" + keys;
  }
  std::string shaft;
  if (word == "on") words >> shaft >> word;
  if (word == "from") {
    return "type: variator_sim/CommandedTorque, shaft: " + shaft +
           ", topic: " + rest_behind(" from ");
  }
  const std::string formula = "\"" + rest_behind(": ") + "\"";
  if (!shaft.empty()) {
    shaft.pop_back();
    return "type: variator_sim/ExpressionTorque, shaft: " + shaft + ", torque: " + formula;
  }
  *is_constraint = true;
  const std::size_t order = line.find(" of order ");
  return "type: variator_sim/ExpressionConstraint, order: " +
         (order < line.find(':') ? line.substr(order + 10, 1) : "2") + ", expression: " + formula;
}

/// A scene's text. `shafts` are names with their inertias, "drive 0.8, load 2"; `elements` are
/// lines as of elementKeys; `keys` are further lines.
inline std::string sceneText(const std::string& shafts, const std::vector<std::string>& elements,
                             const std::string& keys = "") {
  std::string text;
  const auto list = [](std::string* names, const std::string& name) {
    *names += (names->empty() ? "" : ", ") + name;
  };
  std::string shaft_names;
  std::istringstream parts(shafts);
  for (std::string part; std::getline(parts >> std::ws, part, ',');) {
    const std::string name = part.substr(0, part.find(' '));
    list(&shaft_names, name);
    if (name != part) text += name + ": {inertia: " + part.substr(name.size() + 1) + "}\n";
  }
  std::string torques;
  std::string constraints;
  for (const std::string& line : elements) {
    const std::string name = line.substr(0, line.find_first_of(" :"));
    bool is_constraint = false;
    text += name + ": {" + elementKeys(line, &is_constraint) + "}\n";
    list(is_constraint ? &constraints : &torques, name);
  }
  return "shafts: [" + shaft_names + "]\n" +
         (torques.empty() ? "" : "torques: [" + torques + "]\n") +
         (constraints.empty() ? "" : "constraints: [" + constraints + "]\n") + text + keys + "\n";
}

inline Scene sceneFromText(const std::string& shafts, const std::vector<std::string>& elements,
                           const std::string& keys = "") {
  return sceneFromText(sceneText(shafts, elements, keys));
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
  LawContext context("added", reader, scene.shafts, scene.inputs, scene.symbols, scene.graph);
  torque->configure(context);
  scene.torques.push_back(torque);
}

/// False where `scene` refuses it: `taylor` needs a motion that has series.
inline bool takes(const Scene& scene, StepperKind stepper) {
  const bool needs_series = stepper == StepperKind::kTaylor || stepper == StepperKind::kTaylorFixed;
  if (!needs_series && scene.holdNames().empty()) return true;
  try {
    Simulation simulation(withStepper(scene, stepper));
  } catch (const SceneError& error) {
    if (error.keyPath() == "solver/stepper") return false;
  }
  return true;
}

}  // namespace variator_sim::test
