/// The inertia matrix of a scene, read and checked.
#pragma once

#include "variator_sim/parameter_tree.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Reads `inertia` of every shaft and `inertia_coupling` into `scene`, whose shafts are known.
/// Throws SceneError unless J is positive definite at every angle. Formulas are left for
/// `readInertiaFormulas`.
void readInertia(ParameterReader& root, Scene* scene);

/// Reads those that are formulas; the scene's initial values, inputs and tables are known. Throws
/// SceneError unless J is positive definite at the start.
void readInertiaFormulas(ParameterReader& root, Scene* scene);

}  // namespace variator_sim
