/// Groups of named quantities of a motion beside its Sample.
#pragma once

#include <array>

namespace variator_sim {

/// The names of a group and their order depend on the scene only (Simulation::quantityNames).
enum class QuantityGroup {
  kElements,   ///< torques and constraints: ELEMENT/SHAFT/torque, N m, for each shaft that a
               ///< torque acts on; ELEMENT/power, the sum of torque * velocity over these, W;
               ///< ELEMENT/OUTPUT, its own unit
  kInputs,     ///< commanded inputs in force, after hold and clamp, each in its own unit
  kOutputs,    ///< the scene's own `outputs`, each in its own unit
  kStates,     ///< the scene's `states`, each in its own unit
  kVariables,  ///< its `variables`, the same
  kPrinciple   ///< SHAFT/reaction_torque_covariant_rate, G, N m/s; then principle/Z, the measure
               ///< 1/2 G^T J^-1 G of its length, N m/s^4, and principle/constraint_measure,
               ///< 1/2 R^T J^-1 R, N m/s^2
};

constexpr std::array<QuantityGroup, 6> kQuantityGroups{
    QuantityGroup::kElements, QuantityGroup::kInputs,    QuantityGroup::kOutputs,
    QuantityGroup::kStates,   QuantityGroup::kVariables, QuantityGroup::kPrinciple};

/// Returns "elements", "inputs", ..: the name of the group's columns and its topic.
const char* toString(QuantityGroup group);

}  // namespace variator_sim
