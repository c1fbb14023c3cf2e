/// Steady states as users get them, from the command line and from Python.
#pragma once

#include <string>

#include "variator_sim/motion_state.h"
#include "variator_sim/operating_point.h"

namespace variator_sim {

/// A state that a motion can go on from, its inputs at rest where they are.
MotionState makeState(const OperatingPoint& point, const Scene& scene);

/// "stable, ..." or "unstable: ...", by the eigenvalues of the linear model there, or why that is
/// not known.
std::string describeStability(const Scene& scene, const OperatingPoint& point);

}  // namespace variator_sim
