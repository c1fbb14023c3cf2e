/// Overrides as texts: PATH=VALUE, VALUE in YAML.
#pragma once

#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Sets one value of a scene's tree (setValue) as `text` says it: "drive/inertia=1.2",
/// "initial/velocity=[5, 2]". Throws SceneError.
void applyOverride(ParameterTree& tree, const std::string& text);

/// Applies and removes the tree's own key `overrides`: one text with spaces between its overrides
/// (a value with spaces stands in brackets or quotes), or a list of texts. Later ones win.
void applyOwnOverrides(ParameterTree& tree);

}  // namespace variator_sim
