/// The readers and checks that readScene is made of; the functions are in the files of their names.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "variator_sim/scene.h"

namespace variator_sim {

/// The context of the formulas that `reader` has, which must outlive it.
inline ComponentContext contextOf(const std::string& name, ParameterReader& reader, Scene* scene) {
  return {name, reader, scene->shafts, scene->inputs, scene->symbols, scene->graph};
}

// scene_names.cpp

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

// scene_parts.cpp

/// Returns `tree`, if it has parts, with the content of these in its own lists: the element NAME of
/// the part PART, whose dictionary holds a scene, becomes PART/NAME, and so do the names that its
/// texts read; names that the part does not have are those of the scene around it. `connect` makes
/// shafts of a part those of the scene, with the sum of their inertias. A part's solver, and its
/// keys of the node, count only where it is a scene by itself. Throws SceneError.
std::optional<ParameterTree> mergeParts(const ParameterTree& tree,
                                        const std::vector<std::string>& node_keys);

// scene_inertia.cpp

/// Reads `inertia` of every shaft and `inertia_coupling` into `scene`, whose shafts are known.
/// Returns true where some are formulas; these are read only when `knows_names`: the scene's
/// initial values, inputs and tables are there. Throws SceneError unless J is positive definite at
/// every angle but for shafts of inertia 0; with formulas, at the start.
bool readInertia(ParameterReader& root, bool knows_names, Scene* scene);

/// Makes J regular where shafts have no inertia. With a constraint f = c omega + constant, whose
/// reaction is c' lambda, J + w c c' has the motion and the multiplier of J, since c epsilon = 0:
///     J epsilon - c' lambda = Q,   c epsilon = 0.
/// It is positive definite if no motion of massless shafts alone obeys the constraints; else there
/// is no unique motion, and SceneError names a shaft.
void tieMasslessShafts(Scene* scene);

// scene_symbols.cpp

/// Rejects names of `list` that formulas cannot use. Throws SceneError.
void checkFormulaNames(const SceneNames& scene, const char* list,
                       const std::vector<std::string>& names);

/// Reads the dictionaries of the inputs and tables in `names`, adds the inputs to `inputs`, and
/// sentences about tables to `warnings`. Throws SceneError.
SceneSymbols readSceneSymbols(ParameterReader& root, const SceneNames& names,
                              std::vector<CommandInputSettings>& inputs,
                              std::vector<std::string>* warnings);

// scene_memory.cpp

/// Declares variables, states and controllers, which formulas read by their names: `scene` gets
/// their inputs and symbols. Throws SceneError.
void declareMemory(ParameterReader& root, const SceneNames& names, Scene* scene);

/// Reads rates and events, which may read the torque, power and outputs of each element: `scene`
/// gets names of these for observers, which outputs are, too. Does nothing where an element is
/// missing, whose fault explains those here. Throws SceneError.
void readMemory(ParameterReader& root, const SceneNames& names, Scene* scene);

/// Rejects delayed formulas that read what the motion's program has no power series of.
void checkDelays(const Scene& scene);

// scene_observers.cpp

/// Names the formulas that only observers may read (`rate`, `when`, `set` and outputs) in the
/// scene's symbols. A formula is made when its name occurs, while `scene`, whose torques and
/// constraints are known, is at its place. `knows_rates`: the rates of its states are.
void nameObservers(Scene* scene, bool knows_rates);

/// Adds the names that outputs alone read: G_SHAFT, Z, constraint_measure.
void namePrinciple(Scene* scene);

/// Reads an output's keys: `expression` (SI units), `parameters`, `unit` (optional, "rpm": the
/// value is told in it). Throws SceneError.
Output readOutput(ComponentContext& context);

// scene_checks.cpp

/// Returns the numbers of a scene that share no digit with a number near 1: beyond 1e16, or below
/// 1e-16 but not 0, as the end of a message about their consequences: "; numbers that may be to
/// blame: a/inertia = 1.7e+308"; "" if there are none.
std::string describeExtremeNumbers(const ParameterTree& scene);

/// Adds a warning to `scene` for a constraint of order 1 whose reactions have power under `gauss`.
void warnOfEnergy(const Constraint& constraint, Scene* scene);

/// Compares the gradient of each OpaqueFunction with differences of its values, at the arguments
/// that its law calls it with at the scene's start and at a few states near it. Throws SceneError
/// at the first entry that does not fit, with both values and the arguments.
///
/// Differences are noisy and blind at kinks, so an entry is rejected only if they are certain: they
/// converge as the step shrinks, and their limit is not the stated value; and all that at a second
/// state nearby, off a kink, as well. Arguments with values that are not finite are skipped.
void verifyDerivatives(const Scene& scene);

}  // namespace variator_sim
