/// Named quantities of a scene at a state: what its elements do, its inputs, its own outputs.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "variator_sim/quantity_group.h"
#include "variator_sim/scene.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// They stand aside of the motion: nothing of it is computed from them, and they are computed for
/// who asks only.
class Quantities {
 public:
  /// `scene` has to outlive it.
  explicit Quantities(const Scene& scene);

  const std::vector<std::string>& names(QuantityGroup group) const {
    return names_[static_cast<std::size_t>(group)];
  }
  /// names(group).size() values. NaN where there is none. [loop]
  void calc(QuantityGroup group, const StateView& state, double* values) const;

 private:
  void calcElements(const StateView& state, double* values) const;

  const Scene& scene_;
  std::array<std::vector<std::string>, kQuantityGroups.size()> names_;
  /// Per torque and per constraint.
  std::vector<std::vector<int>> shafts_;
  std::vector<std::size_t> torque_outputs_;
  std::vector<std::size_t> constraint_outputs_;
};

}  // namespace variator_sim
