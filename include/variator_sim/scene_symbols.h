/// Inputs and tables that a scene names for all of its components.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "variator_sim/expression/graph.h"
#include "variator_sim/table.h"

namespace variator_sim {

using NamedTables = std::map<std::string, std::shared_ptr<const Table>>;

struct SceneSymbols {
  /// Commanded inputs, variables and states: indices into StateView::input.
  std::map<std::string, int> inputs;
  NamedTables tables;
  /// Inputs that are played from a file, over time.
  NamedTables played;
  /// Formulas that have names: values of controllers and, for outputs, those of other outputs.
  std::map<std::string, expression::Node> values;
  /// Formulas for observers only, made when they are read.
  std::map<std::string, std::function<expression::Node()>> observed;
  /// The names that only observers may read.
  std::shared_ptr<std::set<std::string>> of_elements = std::make_shared<std::set<std::string>>();
};

}  // namespace variator_sim
