/// Inputs and tables that a scene names for all of its components.
#pragma once

#include <map>
#include <memory>
#include <string>

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
  std::map<std::string, int> inputs;  ///< indices into StateView::input
  NamedTables tables;
  /// Inputs that are played from a file, over time.
  std::map<std::string, std::shared_ptr<const Table>> played;
};

}  // namespace variator_sim
