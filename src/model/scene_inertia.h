/// The inertia matrix of a scene, read and checked.
#pragma once

#include "variator_sim/parameter_tree.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Reads `inertia` of every shaft and `inertia_coupling` into `scene`, whose shafts are known.
/// Throws SceneError unless J is positive definite at every angle.
void readInertia(ParameterReader& root, Scene* scene);

}  // namespace variator_sim
