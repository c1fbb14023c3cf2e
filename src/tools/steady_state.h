/// Steady states for the command line and for Python.
#pragma once

#include <string>

#include "variator_sim/motion_state.h"
#include "variator_sim/operating_point.h"

namespace variator_sim {

/// Returns a state from which a motion can continue, its inputs constant.
MotionState makeState(const OperatingPoint& point, const Scene& scene);

/// Returns "stable, ..." or "unstable: ...", by the eigenvalues of the linear model there, or why
/// that is not known.
std::string describeStability(const Scene& scene, const OperatingPoint& point);

}  // namespace variator_sim
