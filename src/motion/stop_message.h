/// Why a motion has stopped or cannot start, in words: the element that is to blame, and what would
/// help. Not in the loop.
#pragma once

#include <string>

#include "integrate/diagnosis.h"
#include "variator_sim/scene.h"

namespace variator_sim {

struct Motion;

/// A sentence for the status of a motion that has stopped; "" while it goes on.
std::string describeStop(Motion& motion);

/// A sentence: why a state, whose accelerations are `given`, cannot be gone on from.
std::string describeInconsistency(PrincipleSystem& system, const Start& start, const double* given);

/// Throws a SceneError that says what is wrong with initial values which contradict the
/// constraints, and what would do.
[[noreturn]] void throwInitialError(PrincipleSystem& system, const Scene& scene,
                                    const Start& start);

}  // namespace variator_sim
