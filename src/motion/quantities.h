/// Named quantities of a scene at a state: of its elements, its inputs, its own outputs.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "variator_sim/quantity_group.h"
#include "variator_sim/scene.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// They are pure observers: the motion does not depend on them, and they are computed only on
/// request.
class Quantities {
 public:
  /// `scene` has to outlive it.
  explicit Quantities(const Scene& scene);

  const std::vector<std::string>& names(QuantityGroup group) const {
    return names_[static_cast<std::size_t>(group)];
  }
  /// Writes names(group).size() values, NaN for those that do not exist. [loop]
  void calc(QuantityGroup group, const StateView& state, double* values) const;

 private:
  void calcElements(const StateView& state, double* values) const;
  void calcInputs(InputKind kind, const StateView& state, double* values) const;

  const Scene& scene_;
  std::array<std::vector<std::string>, kQuantityGroups.size()> names_;
  /// Shafts per torque and per constraint.
  std::vector<std::vector<int>> shafts_;
  std::vector<std::size_t> torque_outputs_;
  std::vector<std::size_t> constraint_outputs_;
};

}  // namespace variator_sim
