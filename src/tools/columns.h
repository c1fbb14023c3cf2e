/// The columns of samples: names and values, in one order for all writers.
#pragma once

#include <cstring>
#include <string>
#include <type_traits>
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

/// The numbers of a Sample: every column of the state is one of them.
constexpr std::size_t kSampleNumbers = sizeof(Sample) / sizeof(double);
static_assert(std::is_standard_layout_v<Sample> && sizeof(Sample) % sizeof(double) == 0);

struct Column {
  std::string name;   ///< e.g. "drive/velocity", "outputs/ratio", "energy/kinetic"
  std::size_t place;  ///< among the sample's numbers, or kSampleNumbers + that of the quantity
};

/// Returns "time" and the other columns.
std::vector<Column> listColumns(const Simulation& simulation, const ColumnGroups& groups);

/// Returns one of a sample's numbers.
inline double numberAt(const Sample& sample, std::size_t place) {
  double number;
  std::memcpy(&number, reinterpret_cast<const char*>(&sample) + place * sizeof number,
              sizeof number);
  return number;
}

/// Returns the names of the columns.
std::vector<std::string> columnNames(const Simulation& simulation, const ColumnGroups& groups);

/// Returns the names with the units that outputs state: "outputs/speed [rpm]".
std::vector<std::string> columnTitles(const Simulation& simulation, const ColumnGroups& groups);

/// Writes one sample's values in the order of `listColumns`.
class RowMaker {
 public:
  RowMaker(const Simulation& simulation, const ColumnGroups& groups);

  std::size_t quantityCount() const { return quantity_count_; }
  std::size_t columnCount() const { return places_.size(); }
  /// `quantities`: those of the groups, group after group; `row`: columnCount values.
  void write(const Sample& sample, const double* quantities, double* row) const;

 private:
  std::vector<std::size_t> places_;
  std::size_t quantity_count_ = 0;
};

}  // namespace variator_sim
