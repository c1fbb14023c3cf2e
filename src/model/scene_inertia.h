/// The inertia matrix of a scene, read and checked.
#pragma once

#include "variator_sim/parameter_tree.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Reads `inertia` of every shaft and `inertia_coupling` into `scene`, whose shafts are known.
/// Throws SceneError unless J is positive definite at every angle but for shafts of inertia 0.
/// Formulas are left for `readInertiaFormulas`.
void readInertia(ParameterReader& root, Scene* scene);

/// Reads those that are formulas; the scene's initial values, inputs and tables are known. Throws
/// SceneError unless J is positive definite at the start.
void readInertiaFormulas(ParameterReader& root, Scene* scene);

/// Makes J regular where shafts have no inertia. With a constraint f = c omega + constant, whose
/// reaction is c' lambda, J + w c c' has the motion and the multiplier of J, since c epsilon = 0:
///     J epsilon - c' lambda = Q,   c epsilon = 0.
/// It is positive definite if no motion of massless shafts alone obeys the constraints; else there
/// is no unique motion, and SceneError names a shaft.
void tieMasslessShafts(Scene* scene);

}  // namespace variator_sim
