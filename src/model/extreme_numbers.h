/// Numbers of a scene with which sums and products overflow or vanish.
#pragma once

#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// Returns the numbers of a scene that share no digit with a number near 1: beyond 1e16, or below
/// 1e-16 but not 0, as the end of a message about their consequences: "; numbers that may be to
/// blame: a/inertia = 1.7e+308"; "" if there are none.
std::string describeExtremeNumbers(const ParameterTree& scene);

}  // namespace variator_sim
