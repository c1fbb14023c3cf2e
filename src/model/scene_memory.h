/// Reads `variables`, `states` and `events` of a scene, and checks its delays.
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

/// Rejects delayed formulas that read what the motion's program has no power series of.
void checkDelays(const Scene& scene);

}  // namespace variator_sim
