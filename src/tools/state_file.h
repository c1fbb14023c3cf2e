/// States of motions in files (YAML).
#pragma once

#include <string>

#include "variator_sim/motion_state.h"

namespace variator_sim {

class Simulation;

/// The simulation goes on from the state in a file; what the file leaves out is as in the
/// simulation. Inconsistent values are moved where the scene's `initial/project` says so. Throws
/// SceneError.
void readStateFile(const std::string& path, Simulation& simulation);

/// Throws OutputError.
void writeStateFile(const std::string& path, const MotionState& state,
                    const Simulation& simulation);

}  // namespace variator_sim
