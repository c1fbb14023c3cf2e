/// Named quantities of a scene at a state: of its elements, its inputs, its own outputs.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dynamics/dense.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/quantity_group.h"
#include "variator_sim/sample.h"
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
  /// Writes names(group).size() values, NaN for those that do not exist; `sample` is that of
  /// `state`. [loop]
  void calc(QuantityGroup group, const StateView& state, const Sample& sample,
            double* values) const;
  DenseMatrix calcInertia(const StateView& state) const;
  /// True where J, if formulas give it, is not positive definite, or hardly so.
  bool isInertiaLost(const StateView& state) const;

 private:
  void calcOutputs(const StateView& state, const Sample& sample, double* values) const;
  /// Writes G, Z = 1/2 G^T J^-1 G and 1/2 R^T J^-1 R.
  void calcPrinciple(const StateView& state, const Sample& sample, double* values) const;
  void calcElements(const StateView& state, double* values) const;

  const Scene& scene_;
  const bool has_formulas_;       ///< of inertias
  expression::Tape inertia_;      ///< J, if formulas give it
  bool reads_principle_ = false;  ///< some output does
  std::array<std::vector<std::string>, kQuantityGroups.size()> names_;
  struct Element {
    const Law* law;
    const Torque* torque;  ///< the same, or null
    std::vector<int> shafts;
  };
  std::vector<Element> elements_;
  expression::Tape outputs_;          ///< of the scene
  expression::Tape element_outputs_;  ///< of all elements
};

}  // namespace variator_sim
