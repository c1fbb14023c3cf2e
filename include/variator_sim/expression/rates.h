/// Rates of a scene's variables along its motion, and what formulas depend on.
#pragma once

#include <set>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/types.h"

namespace variator_sim::expression {

/// Returns the rates of all variables of a scene with `shaft_count` shafts, for
/// Graph::totalDerivative: phi' = omega, omega' = epsilon, t' = 1, u' and u'' of the inputs,
/// epsilon constant, as its rate is multiplied by C.
inline std::vector<Graph::Rate> ratesOf(Graph& graph, int shaft_count,
                                        const std::set<int>& inputs) {
  std::vector<Graph::Rate> rates = {{slotOf(Source::kTime), graph.constant(1.0)}};
  const auto add = [&](Source of, Source rate, int i) {
    rates.emplace_back(slotOf(of, i), graph.variable(slotOf(rate, i)));
  };
  for (int i = 0; i < shaft_count; ++i) {
    add(Source::kAngle, Source::kVelocity, i);
    add(Source::kVelocity, Source::kAcceleration, i);
  }
  for (const int i : inputs) {
    add(Source::kInput, Source::kInputRate, i);
    add(Source::kInputRate, Source::kInputSecondRate, i);
  }
  return rates;
}

/// Tells if time and angles occur in `nodes`, in a scene of `shaft_count` shafts.
inline Dependence dependenceOf(const Graph& graph, const std::vector<Node>& nodes,
                               int shaft_count) {
  Dependence dependence{false, false};
  for (const Node node : nodes) {
    dependence.time = dependence.time || graph.dependsOn(node, slotOf(Source::kTime));
    for (int i = 0; i < shaft_count; ++i) {
      dependence.angle = dependence.angle || graph.dependsOn(node, slotOf(Source::kAngle, i));
    }
  }
  return dependence;
}

}  // namespace variator_sim::expression
