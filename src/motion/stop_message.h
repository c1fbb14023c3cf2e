/// Why a motion has stopped, the element that is to blame, and what would help. Not in the loop.
#pragma once

#include <string>

#include "motion/motion.h"

namespace variator_sim {

/// A sentence for the status of a motion that has stopped; "" while it goes on.
std::string describeStop(Motion& motion);

}  // namespace variator_sim
