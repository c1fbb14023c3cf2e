/// Where formulas have kinks.
#pragma once

#include <vector>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// The functions whose zeros are the kinks of `nodes`: x of abs(x) and sign(x), a - b of min(a, b)
/// and max(a, b). Each once, kMostSwitches at most: the error estimates have to see the others.
std::vector<Node> findSwitches(Graph& graph, const std::vector<Node>& nodes);
constexpr int kMostSwitches = 64;

}  // namespace variator_sim::expression
