/// A warning of constraints whose reactions have power.
#pragma once

#include "variator_sim/constraint.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Adds it to the warnings of `scene` for a constraint of order 1 under `gauss`.
void warnOfEnergy(const Constraint& constraint, Scene* scene);

}  // namespace variator_sim
