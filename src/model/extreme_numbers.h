/// Numbers of a scene that sums and products overflow or vanish with.
#pragma once

#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// The numbers of a scene, as read, that share no digit with a number near 1: beyond 1e16, or below
/// 1e-16 but not 0. As what a message about their consequences ends with, which names another key
/// or none: "; numbers that may be to blame: a/inertia = 1.7e+308"; "" where there are none.
std::string describeExtremeNumbers(const ParameterTree& scene);

}  // namespace variator_sim
