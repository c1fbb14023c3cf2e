#include "tools/columns.h"

#include <algorithm>
#include <cstddef>
#include <stdexcept>

#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

/// A number that a sample has for every shaft or constraint, and where that of the first lies.
struct SampleColumn {
  const char* name;
  std::size_t offset;
  std::size_t error_offset = 0;  ///< of the estimated error, if there is one
};
constexpr SampleColumn kShaftColumns[] = {
    {"/angle", offsetof(Sample, angle), offsetof(Sample, angle_error)},
    {"/velocity", offsetof(Sample, velocity), offsetof(Sample, velocity_error)},
    {"/acceleration", offsetof(Sample, acceleration), offsetof(Sample, acceleration_error)},
    {"/applied_torque", offsetof(Sample, applied_torque)},
    {"/reaction_torque", offsetof(Sample, reaction_torque)},
    {"/reaction_torque_rate", offsetof(Sample, reaction_torque_rate)}};
constexpr SampleColumn kConstraintColumns[] = {{"/residual", offsetof(Sample, residual)},
                                               {"/multiplier", offsetof(Sample, multiplier)}};
/// In the order of Energy.
constexpr const char* kEnergyColumns[] = {"energy/kinetic", "energy/applied", "energy/reactions",
                                          "power/applied", "power/reactions"};

/// In the order of the columns.
std::vector<std::string> groupNames() {
  std::vector<std::string> names{"state"};
  for (const QuantityGroup group : kQuantityGroups) names.emplace_back(toString(group));
  names.emplace_back("energy");
  return names;
}

}  // namespace

ColumnGroups readColumnGroups(const std::string& list) {
  const std::vector<std::string> allowed = groupNames();
  std::vector<std::string> wanted;
  for (const std::string& name : splitAt(list, ',')) {
    if (!contains(allowed, name)) {
      throw std::invalid_argument(inQuotes(name) + " is no group of columns" +
                                  suggestAmong(name, allowed));
    }
    if (contains(wanted, name)) throw std::invalid_argument(inQuotes(name) + " is given twice");
    wanted.push_back(name);
  }
  ColumnGroups columns;
  columns.state = contains(wanted, "state");
  for (const QuantityGroup group : kQuantityGroups) {
    if (contains(wanted, toString(group))) columns.quantities.push_back(group);
  }
  columns.energy = contains(wanted, "energy");
  return columns;
}

std::vector<Column> listColumns(const Simulation& simulation, const ColumnGroups& groups) {
  const Scene& scene = simulation.scene();
  std::vector<Column> columns{{"time", offsetof(Sample, time) / sizeof(double)}};
  const auto add = [&](const std::string& name, std::size_t offset, std::size_t index) {
    columns.push_back({name, offset / sizeof(double) + index});
  };
  const auto addError = [&](std::size_t offset, std::size_t index) {
    if (groups.errors && offset != 0) add(columns.back().name + "/estimated_error", offset, index);
  };
  for (std::size_t i = 0; groups.state && i < scene.shafts.size(); ++i) {
    for (const SampleColumn& it : kShaftColumns) {
      add(scene.shafts[i] + it.name, it.offset, i);
      addError(it.error_offset, i);
    }
  }
  for (std::size_t m = 0; groups.state && m < scene.constraints.size(); ++m) {
    for (const SampleColumn& it : kConstraintColumns) {
      add(scene.constraints[m]->name() + it.name, it.offset, m);
    }
  }
  std::size_t quantity = kSampleNumbers;
  for (const QuantityGroup group : groups.quantities) {
    // Elements and shafts have unique names in the scene; names of inputs and outputs include the
    // group.
    const bool is_unique = group == QuantityGroup::kElements || group == QuantityGroup::kPrinciple;
    const std::string prefix = is_unique ? "" : std::string(toString(group)) + "/";
    std::size_t n = 0;
    for (const std::string& name : simulation.quantityNames(group)) {
      columns.push_back({prefix + name, quantity++});
      if (group == QuantityGroup::kStates) addError(offsetof(Sample, state_error), n++);
    }
  }
  if (groups.energy) {
    std::size_t n = 0;
    for (const char* name : kEnergyColumns) add(name, offsetof(Sample, energy), n++);
  }
  for (const std::string& name : groups.derivatives) columns.push_back({name, quantity++});
  return columns;
}

std::vector<std::string> columnNames(const Simulation& simulation, const ColumnGroups& groups) {
  std::vector<std::string> names;
  for (const Column& it : listColumns(simulation, groups)) names.push_back(it.name);
  return names;
}

std::vector<std::string> columnTitles(const Simulation& simulation, const ColumnGroups& groups) {
  std::vector<std::string> titles = columnNames(simulation, groups);
  for (const Output& output : simulation.scene().outputs) {
    const auto found = std::find(titles.begin(), titles.end(), "outputs/" + output.name());
    if (found != titles.end() && !output.unit().empty()) *found += " [" + output.unit() + "]";
  }
  return titles;
}

RowMaker::RowMaker(const Simulation& simulation, const ColumnGroups& groups) {
  for (const Column& it : listColumns(simulation, groups)) {
    places_.push_back(it.place);
    if (it.place >= kSampleNumbers) ++quantity_count_;
  }
}

void RowMaker::write(const Sample& sample, const double* quantities, double* row) const {
  for (const std::size_t place : places_) {
    *row++ = place < kSampleNumbers ? numberAt(sample, place) : quantities[place - kSampleNumbers];
  }
}

}  // namespace variator_sim
