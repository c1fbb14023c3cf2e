/// From nodes of a graph to terms for reading; what occurs in several places gets a name.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "expression/term.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

/// What things are called.
struct Names {
  std::map<int, Symbol> variables;  ///< by slot
  std::map<int, Symbol> tables;     ///< of one variable, by Graph::Entry::slot
  std::map<int, Symbol> tables2;    ///< of two variables
  std::map<int, Symbol> nodes;      ///< by index: what a node is called where it is used repeatedly
  std::set<std::string> taken;      ///< names that a1, a2, .. may not take
};

/// Some nodes of a graph for reading.
struct Terms {
  std::vector<TermPtr> roots;  ///< one for each node
  /// What occurs in at least two places, and is worth a name: `name = term`, each before it is used
  /// by another one.
  std::vector<std::pair<Symbol, TermPtr>> shared;
};

Terms makeTerms(const Graph& graph, const std::vector<Node>& nodes, const Names& names);

}  // namespace variator_sim::expression
