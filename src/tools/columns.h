/// The columns of samples: names and values, in one order for all writers.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "variator_sim/quantity_group.h"
#include "variator_sim/sample.h"

namespace variator_sim {

class Simulation;

/// The groups of columns (of topics in a bag) to write, in this order.
struct ColumnGroups {
  bool state = true;
  bool errors = false;                    ///< estimated, beside those of the state
  std::vector<QuantityGroup> quantities;  ///< in their own order
  bool energy = false;
  std::vector<std::string> derivatives;  ///< names of their columns (Sensitivity)
};

/// Reads a list such as "state,energy", each group once. Throws std::invalid_argument.
ColumnGroups readColumnGroups(const std::string& list);

/// Returns "time" and the other columns, e.g. "drive/velocity", "outputs/ratio", "energy/kinetic".
std::vector<std::string> columnNames(const Simulation& simulation, const ColumnGroups& groups);

/// Returns the names with the units that outputs state: "outputs/speed [rpm]".
std::vector<std::string> columnTitles(const Simulation& simulation, const ColumnGroups& groups);

/// Writes one sample's values in the order of `columnNames`.
class RowMaker {
 public:
  RowMaker(const Simulation& simulation, const ColumnGroups& groups);

  std::size_t quantityCount() const { return quantity_count_; }
  std::size_t columnCount() const { return column_count_; }
  /// `quantities`: those of the groups, group after group; `row`: columnCount values.
  void write(const Sample& sample, const double* quantities, double* row) const;

 private:
  ColumnGroups groups_;
  int shaft_count_;
  int constraint_count_;
  std::size_t quantity_count_ = 0;
  std::size_t first_state_ = 0;  ///< of the quantities with errors
  std::size_t state_count_ = 0;
  std::size_t column_count_ = 1;
};

}  // namespace variator_sim
