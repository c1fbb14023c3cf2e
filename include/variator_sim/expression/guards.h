/// Where formulas have kinks and jumps.
#pragma once

#include <vector>

#include "variator_sim/expression/graph.h"
#include "variator_sim/guard.h"

namespace variator_sim::expression {

/// The guards of `nodes`: of abs(x) and sign(x) the sign of x, of min(a, b), max(a, b) and of what
/// selects by a <= b that of a - b, of a table between which of its points the argument lies. Each
/// once; those of sign and of what selects may jump.
std::vector<GuardPtr> findGuards(Graph& graph, const std::vector<Node>& nodes);
/// The points, s, of tables in `nodes` whose argument is the time itself; they have no guard.
std::vector<double> findInstants(const Graph& graph, const std::vector<Node>& nodes);

}  // namespace variator_sim::expression
