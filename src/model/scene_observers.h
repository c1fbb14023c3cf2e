/// The formulas that only observers of a motion may read: `rate`, `when`, `set` and outputs.
#pragma once

#include "variator_sim/scene.h"

namespace variator_sim {

/// Names them in the scene's symbols. A formula is made when its name occurs, while `scene`, whose
/// torques and constraints are known, is at its place. `knows_rates`: the rates of its states are.
void nameObservers(Scene* scene, bool knows_rates);

}  // namespace variator_sim
