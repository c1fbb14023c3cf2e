/// Where formulas have kinks and jumps.
#pragma once

#include <vector>

#include "variator_sim/expression/graph.h"
#include "variator_sim/guard.h"

namespace variator_sim::expression {

/// A formula whose sign decides on a branch of abs, min, max, sign or a comparison.
struct Branch {
  Node argument;
  const char* function;  ///< as formulas write it
  bool jumps;            ///< of sign and comparisons
};
/// Those in `nodes`, by argument, each once.
std::vector<Branch> findBranches(Graph& graph, const std::vector<Node>& nodes);
/// Points of tables that an argument passes.
struct Passage {
  Node argument;
  std::vector<double> points;
};
/// Those of all tables in `nodes`, by argument, each once.
std::vector<Passage> findPassages(const Graph& graph, const std::vector<Node>& nodes);

/// The guards of `nodes`: of abs(x) and sign(x) the sign of x, of min(a, b), max(a, b) and of what
/// selects by a <= b that of a - b, of a table between which of its points the argument lies. Each
/// once; those of sign and of what selects may jump.
std::vector<GuardPtr> findGuards(Graph& graph, const std::vector<Node>& nodes);
/// The points, s, of tables in `nodes` whose argument is the time itself; they have no guard.
std::vector<double> findInstants(const Graph& graph, const std::vector<Node>& nodes);

}  // namespace variator_sim::expression
