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
  kOutputs    ///< the scene's own `outputs`, each in its own unit
};

constexpr std::array<QuantityGroup, 3> kQuantityGroups{
    QuantityGroup::kElements, QuantityGroup::kInputs, QuantityGroup::kOutputs};

/// Returns "elements", "inputs", "outputs": the name of the group's columns and its topic.
const char* toString(QuantityGroup group);

}  // namespace variator_sim
