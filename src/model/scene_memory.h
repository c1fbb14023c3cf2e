/// Reads `variables`, `states` and `events` of a scene.
#pragma once

#include "model/scene_names.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Declares variables, states and controllers, which formulas read by their names: `scene` gets
/// their inputs and symbols. Throws SceneError.
void declareMemory(ParameterReader& root, const SceneNames& names, Scene* scene);

/// Reads rates and events, which may read the torque, power and outputs of each element: `scene`
/// gets names of these for observers, which outputs are, too. Does nothing where an element is
/// missing, whose fault explains those here. Throws SceneError.
void readMemory(ParameterReader& root, const SceneNames& names, Scene* scene);

}  // namespace variator_sim
