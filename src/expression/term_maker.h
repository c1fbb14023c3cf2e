/// Converts nodes of a graph to terms for reading; repeated parts get a name.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "expression/term.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// The names of variables, tables and nodes.
struct Names {
  std::map<int, Symbol> variables;  ///< by slot
  std::map<int, Symbol> tables;     ///< by Graph::Entry::slot
  std::map<int, Symbol> nodes;      ///< by index: names of nodes that are used repeatedly
  std::set<std::string> taken;      ///< names that a1, a2, .. may not take
};

/// Some nodes of a graph for reading.
struct Terms {
  std::vector<TermPtr> roots;  ///< one for each node
  /// Repeated parts that deserve a name: `name = term`, each before another one uses it.
  std::vector<std::pair<Symbol, TermPtr>> shared;
};

Terms makeTerms(const Graph& graph, const std::vector<Node>& nodes, const Names& names);

}  // namespace variator_sim::expression
