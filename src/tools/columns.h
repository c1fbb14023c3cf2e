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
struct SampleBlock;
struct Scene;

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

/// Returns one of a sample's numbers.
inline double numberAt(const Sample& sample, std::size_t place) {
  double number;
  std::memcpy(&number, reinterpret_cast<const char*>(&sample) + place * sizeof number,
              sizeof number);
  return number;
}

/// "time" and the columns of the groups.
class Columns {
 public:
  Columns(const Simulation& simulation, const ColumnGroups& groups);

  /// E.g. "drive/velocity", "outputs/ratio", "energy/kinetic".
  const std::vector<std::string>& names() const { return names_; }
  /// Each column's place among a sample's numbers, or kSampleNumbers + that of the quantity.
  const std::vector<std::size_t>& places() const { return places_; }
  /// Appends the values of the samples to `rows`.
  void append(const SampleBlock& block, std::vector<double>* rows) const;

 private:
  void add(const std::string& name, std::size_t offset, std::size_t index);
  void addState(const Scene& scene, bool has_errors);
  void addQuantity(const std::string& name);

  std::vector<std::string> names_;
  std::vector<std::size_t> places_;
  std::size_t quantity_count_ = 0;
};

}  // namespace variator_sim
