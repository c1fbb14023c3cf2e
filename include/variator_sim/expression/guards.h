/// Kinks and jumps of formulas.
#pragma once

#include <vector>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// A formula whose sign decides the mode of a function: x of abs(x) and sign(x), a - b of min(a,
/// b), max(a, b) and comparisons.
struct Branch {
  Node argument;
  const char* function;  ///< as formulas write it
  bool jumps;            ///< true for sign and comparisons
};
/// Returns the branches in `nodes`, by argument, each once.
std::vector<Branch> findBranches(Graph& graph, const std::vector<Node>& nodes);
/// Points of tables that an argument passes.
struct Passage {
  Node argument;
  std::vector<double> points;
  int smoothness;  ///< of the table there: Table::smoothness
};
/// Returns the passages of all tables in `nodes`, by argument, each once.
std::vector<Passage> findPassages(const Graph& graph, const std::vector<Node>& nodes);

/// Returns the number of switching functions of `nodes`: their branches and passages, but of smooth
/// tables over the time.
std::size_t countSwitchingFunctions(Graph& graph, const std::vector<Node>& nodes);

}  // namespace variator_sim::expression
