#include "tools/columns.h"

#include <algorithm>
#include <utility>

#include "variator_sim/nearest_name.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

constexpr const char* kShaftColumns[] = {"angle",           "velocity",
                                         "acceleration",    "applied_torque",
                                         "reaction_torque", "reaction_torque_rate"};
/// Number of leading columns with an estimated error.
constexpr int kEstimated = 3;
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

std::vector<std::string> columnNames(const Simulation& simulation, const ColumnGroups& groups) {
  const Scene& scene = simulation.scene();
  std::vector<std::string> names{"time"};
  if (groups.state) {
    for (const std::string& shaft : scene.shafts) {
      int n = 0;
      for (const char* column : kShaftColumns) {
        names.push_back(shaft + "/" + column);
        if (groups.errors && n++ < kEstimated) names.push_back(names.back() + "/estimated_error");
      }
    }
    for (const ConstraintPtr& constraint : scene.constraints) {
      names.push_back(constraint->name() + "/residual");
      names.push_back(constraint->name() + "/multiplier");
    }
  }
  for (const QuantityGroup group : groups.quantities) {
    // Elements and shafts have unique names in the scene; names of inputs and outputs include the
    // group.
    const bool is_unique = group == QuantityGroup::kElements || group == QuantityGroup::kPrinciple;
    const std::string prefix = is_unique ? "" : std::string(toString(group)) + "/";
    for (const std::string& name : simulation.quantityNames(group)) {
      names.push_back(prefix + name);
      if (groups.errors && group == QuantityGroup::kStates)
        names.push_back(names.back() + "/estimated_error");
    }
  }
  if (groups.energy)
    names.insert(names.end(), std::begin(kEnergyColumns), std::end(kEnergyColumns));
  names.insert(names.end(), groups.derivatives.begin(), groups.derivatives.end());
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

RowMaker::RowMaker(const Simulation& simulation, const ColumnGroups& groups)
    : groups_(groups),
      shaft_count_(simulation.scene().shaftCount()),
      constraint_count_(simulation.scene().constraintCount()),
      column_count_(columnNames(simulation, groups).size()) {
  for (const QuantityGroup group : groups.quantities) {
    const std::size_t count = simulation.quantityNames(group).size();
    if (group == QuantityGroup::kStates && groups.errors) {
      first_state_ = quantity_count_;
      state_count_ = count;
    }
    quantity_count_ += count;
  }
  quantity_count_ += groups_.derivatives.size();
}

void RowMaker::write(const Sample& sample, const double* quantities, double* row) const {
  *row++ = sample.time;
  if (groups_.state) {
    for (int i = 0; i < shaft_count_; ++i) {
      for (const auto& [column, error] :
           {std::pair{sample.angle, sample.angle_error},
            std::pair{sample.velocity, sample.velocity_error},
            std::pair{sample.acceleration, sample.acceleration_error}}) {
        *row++ = column[i];
        if (groups_.errors) *row++ = error[i];
      }
      for (const double* column :
           {sample.applied_torque, sample.reaction_torque, sample.reaction_torque_rate}) {
        *row++ = column[i];
      }
    }
    for (int i = 0; i < constraint_count_; ++i) {
      *row++ = sample.residual[i];
      *row++ = sample.multiplier[i];
    }
  }
  row = std::copy_n(quantities, first_state_, row);
  for (std::size_t i = 0; i < state_count_; ++i) {
    *row++ = quantities[first_state_ + i];
    *row++ = sample.state_error[i];
  }
  const std::size_t told = first_state_ + state_count_;
  const std::size_t derivatives = quantity_count_ - groups_.derivatives.size();
  row = std::copy_n(quantities + told, derivatives - told, row);
  if (groups_.energy) {
    const Energy& energy = sample.energy;
    for (const double value : {energy.kinetic, energy.applied, energy.reactions,
                               energy.applied_power, energy.reaction_power}) {
      *row++ = value;
    }
  }
  std::copy_n(quantities + derivatives, groups_.derivatives.size(), row);
}

}  // namespace variator_sim
