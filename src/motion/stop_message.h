/// Explains in words why a motion has stopped or cannot start: the element to blame, and a remedy.
/// Not in the loop.
#pragma once

#include <string>

#include "integrate/diagnosis.h"
#include "variator_sim/scene.h"

namespace variator_sim {

struct Motion;

/// Returns the explanation of a reason that needs nothing of the motion; "" of the others.
const char* explainReason(StopReason reason);

/// Returns a sentence for the status of a motion that has stopped; "" while it runs.
std::string describeStop(Motion& motion);

/// Returns a sentence why a motion cannot continue from a state with the accelerations `given`.
std::string describeInconsistency(System& system, const Start& start, const double* given);

/// Throws a SceneError that explains initial values which contradict the constraints, with a
/// remedy.
[[noreturn]] void throwInitialError(System& system, const Scene& scene, const Start& start);

}  // namespace variator_sim
