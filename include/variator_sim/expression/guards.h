/// Where formulas have kinks and jumps.
#pragma once

#include <vector>

#include "variator_sim/expression/graph.h"
#include "variator_sim/guard.h"

namespace variator_sim::expression {

/// The guards of `nodes`: of abs(x) and sign(x) the sign of x, of min(a, b) and max(a, b) that of
/// a - b. Each once; those of sign may jump.
std::vector<GuardPtr> findGuards(Graph& graph, const std::vector<Node>& nodes);

}  // namespace variator_sim::expression
