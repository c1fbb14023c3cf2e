/// Values that replace those of a scene before it is read.
#pragma once

#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Puts `value` at `path` of a scene's tree: keys with slashes between, items of a list by their
/// index from 0 ("drive/inertia", "load/inertia/harmonics/0/cosine", "initial/velocity[1]").
/// Missing dictionaries on the way are made; the reader of the scene checks whether it knows the
/// key. Throws SceneError, with the nearest path of the tree, if the path leads into a number or a
/// text, or to an item that a list does not have.
void setValue(ParameterTree& tree, const std::string& path, ParameterTree value);

/// Returns the value at such a path. Throws SceneError, with the nearest path, where there is none.
ParameterTree getValue(const ParameterTree& tree, const std::string& path);

}  // namespace variator_sim
