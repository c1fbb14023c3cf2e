/// The names that a scene lists, and the keys at its root.
#pragma once

#include <string>
#include <vector>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// The names that a scene lists.
struct SceneNames {
  std::vector<std::string> shafts;
  std::vector<std::string> torques;
  std::vector<std::string> constraints;
  std::vector<std::string> inputs;
  std::vector<std::string> tables;
  std::vector<std::string> variables;
  std::vector<std::string> states;
  std::vector<std::string> events;
  std::vector<std::string> outputs;

  std::vector<std::string> all() const;
};

/// One list of names, and its key at the scene's root.
struct SceneList {
  const char* key;
  std::vector<std::string> SceneNames::*names;
};
constexpr SceneList kSceneLists[] = {
    {"shafts", &SceneNames::shafts},           {"torques", &SceneNames::torques},
    {"constraints", &SceneNames::constraints}, {"inputs", &SceneNames::inputs},
    {"tables", &SceneNames::tables},           {"variables", &SceneNames::variables},
    {"states", &SceneNames::states},           {"events", &SceneNames::events},
    {"outputs", &SceneNames::outputs}};

/// Reads the lists and rejects all that `tree` has at its root beside them, the names in them, and
/// the keys of the scene and of the node. `root` reads `tree`. Throws SceneError.
SceneNames readSceneNames(const ParameterTree& tree, ParameterReader& root,
                          const std::vector<std::string>& node_keys);

/// True for ^[A-Za-z][A-Za-z0-9_]*$.
bool isName(const std::string& name);

/// True for a key at a scene's root that is no name in one of its lists.
bool isSceneKey(const std::string& key);

}  // namespace variator_sim
