/// Rates of a scene's variables along its motion, and what formulas depend on.
#pragma once

#include <algorithm>
#include <set>
#include <vector>

#include "variator_sim/expression/tape.h"

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

/// Tells if a variable of `source` occurs in `nodes`.
inline bool reads(const Graph& graph, const std::vector<Node>& nodes, Source source) {
  const std::vector<int> reachable = graph.listReachable(nodes);
  return std::any_of(reachable.begin(), reachable.end(), [&](int n) {
    const Graph::Entry& entry = graph.entry({n});
    return entry.operation == Operation::kVariable && sourceOf(entry.slot) == source;
  });
}

}  // namespace variator_sim::expression
