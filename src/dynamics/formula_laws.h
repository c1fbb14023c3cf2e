/// The laws of a scene that are formulas of its own graph.
#pragma once

#include <cstddef>
#include <vector>

#include "variator_sim/formula_torque.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// `element` as the law that it is; null where that is none of this scene's graph. (An element of
/// another graph, made for itself and not by the scene's reader, is one of its own.)
template <class Law, class Element>
const Law* formulaIn(const Scene& scene, const Element& element) {
  const auto* law = dynamic_cast<const Law*>(element.get());
  return law != nullptr && &law->graph() == scene.graph.get() ? law : nullptr;
}

/// True where both have the very same elements, and their formulas in the very same graph.
inline bool haveSameElements(const Scene& one, const Scene& other) {
  return one.graph == other.graph && one.torques == other.torques &&
         one.constraints == other.constraints;
}

/// Adds the terms of a torque to the sums of the shafts.
inline void addTerms(expression::Graph& graph, const std::vector<FormulaTorque::ShaftNode>& terms,
                     std::vector<expression::Node>& sums) {
  for (const auto& [shaft, term] : terms) {
    expression::Node& sum = sums[static_cast<std::size_t>(shaft)];
    sum = graph.isConstant(sum, 0.0) ? term : graph.add(sum, term);
  }
}

}  // namespace variator_sim
