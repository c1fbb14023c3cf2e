/// Reads the inputs and tables that a scene names for all of its components.
#pragma once

#include <vector>

#include "model/scene_names.h"
#include "variator_sim/command_input.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/scene_symbols.h"

namespace variator_sim {

/// Reads the dictionaries of the inputs and tables in `names`, and adds the inputs to `inputs`.
/// Throws SceneError.
SceneSymbols readSceneSymbols(ParameterReader& root, const SceneNames& names,
                              std::vector<CommandInputSettings>& inputs);

}  // namespace variator_sim
