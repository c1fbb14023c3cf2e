/// Explains in words why a motion has stopped or cannot start: the element to blame, and a remedy.
/// Not in the loop.
#pragma once

#include <string>

#include "motion/diagnosis.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Returns the explanation of a reason that needs nothing of the motion; "" of the others.
const char* explainReason(StopReason reason);

/// Returns a sentence for the status of a motion that has stopped at `state`, where J is `inertia`.
/// `function`: that of the branch at which it stopped, as formulas write it; "" where it is not
/// known.
std::string describeStop(const Scene& scene, const MotionStatus& status, const StateView& state,
                         const Inertia& inertia, const std::string& function);

/// Returns a sentence why a motion cannot continue from a state with the accelerations `given`.
std::string describeInconsistency(System& system, const Start& start, const double* given);

/// Throws a SceneError that explains initial values which contradict the constraints, with a
/// remedy.
[[noreturn]] void throwInitialError(System& system, const Scene& scene, const Start& start);

}  // namespace variator_sim
