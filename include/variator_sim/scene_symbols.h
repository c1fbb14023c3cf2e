/// Inputs and tables that a scene names for all of its components.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "variator_sim/expression/graph.h"
#include "variator_sim/table.h"
#include "variator_sim/table2.h"

namespace variator_sim {

/// A table under `tables`: of one variable or of two; the other one is null.
struct NamedTable {
  std::shared_ptr<const Table> of_one;
  std::shared_ptr<const Table2> of_two;
  int argumentCount() const { return of_two != nullptr ? 2 : 1; }
};
using NamedTables = std::map<std::string, NamedTable>;

struct SceneSymbols {
  /// Commanded inputs, variables and states: indices into StateView::input.
  std::map<std::string, int> inputs;
  NamedTables tables;
  /// Inputs that are played from a file, over time.
  std::map<std::string, std::shared_ptr<const Table>> played;
  /// Formulas that have names: values of controllers and, for outputs, those of other outputs.
  std::map<std::string, expression::Node> values;
  /// Formulas for observers only, made when they are read.
  std::map<std::string, std::function<expression::Node()>> observed;
  /// The names that only observers may read.
  std::shared_ptr<std::set<std::string>> of_elements = std::make_shared<std::set<std::string>>();
};

}  // namespace variator_sim
