/// Explains in words why a motion has stopped: the element to blame, and a remedy. Not in the loop.
#pragma once

#include <string>

#include "variator_sim/law.h"
#include "variator_sim/status.h"

namespace variator_sim {

struct Motion;

/// Returns the explanation of a reason that needs nothing of the motion; "" of the others.
const char* explainReason(StopReason reason);

/// Returns a sentence for the status of a motion, "" unless it has stopped. Writes the element that
/// it names to `culprit`, unless that is null.
std::string describeStop(Motion& motion, const Law** culprit);

}  // namespace variator_sim
