/// States of motions in files (YAML).
#pragma once

#include <string>

#include "variator_sim/motion_state.h"

namespace variator_sim {

class Simulation;

/// Continues the simulation from the state in a file; missing values are the simulation's.
/// Inconsistent values are projected if the scene's `initial/project` allows it. Throws SceneError.
void readStateFile(const std::string& path, Simulation& simulation);

/// Throws OutputError.
void writeStateFile(const std::string& path, const MotionState& state,
                    const Simulation& simulation);

}  // namespace variator_sim
