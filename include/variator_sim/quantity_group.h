/// Groups of named quantities of a motion beside its Sample.
#pragma once

#include <array>

namespace variator_sim {

/// The names of a group and their order depend on the scene only (Simulation::quantityNames).
enum class QuantityGroup {
  kElements,  ///< torques and constraints: ELEMENT/SHAFT/torque, N m, for each shaft that a
              ///< torque acts on; ELEMENT/power, the sum of torque * velocity over these, W;
              ///< ELEMENT/OUTPUT, its own unit
  kInputs,    ///< commanded inputs in force, after hold and clamp, each in its own unit
  kOutputs,   ///< the scene's own `outputs`, each in its own unit
  kStates,    ///< the scene's `states`, each in its own unit
  kVariables  ///< its `variables`, the same
};

constexpr std::array<QuantityGroup, 5> kQuantityGroups{
    QuantityGroup::kElements, QuantityGroup::kInputs, QuantityGroup::kOutputs,
    QuantityGroup::kStates, QuantityGroup::kVariables};

/// Returns "elements", "inputs", ..: the name of the group's columns and its topic.
const char* toString(QuantityGroup group);

}  // namespace variator_sim
