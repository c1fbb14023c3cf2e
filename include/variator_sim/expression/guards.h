/// Kinks and jumps of formulas.
#pragma once

#include <vector>

#include "variator_sim/expression/graph.h"
#include "variator_sim/guard.h"

namespace variator_sim::expression {

/// A formula whose sign decides the mode of abs, min, max, sign or a comparison.
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

/// Returns the switching functions of `nodes`, each once: for abs(x) and sign(x) the sign of x, for
/// min(a, b), max(a, b) and selections by a <= b that of a - b, for a table the piece that contains
/// its argument, but of smooth tables over the time. Formulas may jump at those of sign, selections
/// and tables that hold their values.
std::vector<GuardPtr> findGuards(Graph& graph, const std::vector<Node>& nodes);

}  // namespace variator_sim::expression
