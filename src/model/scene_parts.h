/// Scenes within scenes: `parts`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Returns `tree`, if it has parts, with the content of these in its own lists: the element NAME of
/// the part PART, whose dictionary holds a scene, becomes PART/NAME, and so do the names that its
/// texts read; names that the part does not have are those of the scene around it. `connect` makes
/// shafts of a part those of the scene, with the sum of their inertias. A part's solver, and its
/// keys of the node, count only where it is a scene by itself. Throws SceneError.
std::optional<ParameterTree> mergeParts(const ParameterTree& tree,
                                        const std::vector<std::string>& node_keys);

}  // namespace variator_sim
