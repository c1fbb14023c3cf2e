/// Reads the inputs and tables that a scene names for all of its components.
#pragma once

#include <string>
#include <vector>

#include "model/scene_names.h"
#include "variator_sim/command_input.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/scene_symbols.h"

namespace variator_sim {

/// Rejects names of `list` that formulas cannot use. Throws SceneError.
void checkFormulaNames(const SceneNames& scene, const char* list,
                       const std::vector<std::string>& names);

/// Reads the dictionaries of the inputs and tables in `names`, adds the inputs to `inputs`, and
/// sentences about tables to `warnings`. Throws SceneError.
SceneSymbols readSceneSymbols(ParameterReader& root, const SceneNames& names,
                              std::vector<CommandInputSettings>& inputs,
                              std::vector<std::string>* warnings);

}  // namespace variator_sim
