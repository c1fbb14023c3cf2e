#include "tools/columns.h"

#include <cstddef>
#include <stdexcept>

#include "tools/offline_run.h"

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
constexpr const char* kError = "/estimated_error";

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

Columns::Columns(const Simulation& simulation, const ColumnGroups& groups) {
  add("time", offsetof(Sample, time), 0);
  if (groups.state) addState(simulation.scene(), groups.errors);
  for (const QuantityGroup group : groups.quantities) {
    // Elements and shafts have unique names in the scene; names of inputs and outputs include the
    // group.
    const bool is_unique = group == QuantityGroup::kElements || group == QuantityGroup::kPrinciple;
    const std::string prefix = is_unique ? "" : std::string(toString(group)) + "/";
    const bool has_errors = group == QuantityGroup::kStates && groups.errors;
    std::size_t n = 0;
    for (const std::string& name : simulation.quantityNames(group)) {
      addQuantity(prefix + name);
      if (has_errors) add(prefix + name + kError, offsetof(Sample, state_error), n++);
    }
  }
  if (groups.energy) {
    std::size_t n = 0;
    for (const char* name : kEnergyColumns) add(name, offsetof(Sample, energy), n++);
  }
  for (const std::string& name : groups.derivatives) addQuantity(name);
}

void Columns::addState(const Scene& scene, bool has_errors) {
  for (std::size_t i = 0; i < scene.shafts.size(); ++i) {
    for (const SampleColumn& it : kShaftColumns) {
      add(scene.shafts[i] + it.name, it.offset, i);
      if (has_errors && it.error_offset != 0) add(names_.back() + kError, it.error_offset, i);
    }
  }
  for (std::size_t m = 0; m < scene.constraints.size(); ++m) {
    for (const SampleColumn& it : kConstraintColumns) {
      add(scene.constraints[m]->name() + it.name, it.offset, m);
    }
  }
}

void Columns::add(const std::string& name, std::size_t offset, std::size_t index) {
  names_.push_back(name);
  places_.push_back(offset / sizeof(double) + index);
}

void Columns::addQuantity(const std::string& name) {
  names_.push_back(name);
  places_.push_back(kSampleNumbers + quantity_count_++);
}

void Columns::append(const SampleBlock& block, std::vector<double>* rows) const {
  const double* quantities = block.quantities.data();
  for (const Sample& sample : block.samples) {
    for (const std::size_t place : places_) {
      rows->push_back(place < kSampleNumbers ? numberAt(sample, place)
                                             : quantities[place - kSampleNumbers]);
    }
    quantities += quantity_count_;
  }
}

}  // namespace variator_sim
