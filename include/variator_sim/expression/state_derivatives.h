/// Derivatives of formulas by the whole state, and their dependences.
#pragma once

#include <optional>
#include <set>
#include <utility>
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

/// The derivatives of some nodes by (phi, omega, epsilon), 3s directions q, the first s by the
/// angles. They are exact; entries that are zero by the rules of differentiation are neither stored
/// nor computed. Central differences replace those that are too large to be made.
class StateDerivatives {
 public:
  /// Largest growth of the graph by derivatives, in nodes: they add well below a second to a
  /// scene's loading, and one evaluation takes below a millisecond.
  static constexpr int kMostNodes = 100000;

  /// d node / d x_q, `node` being the index among the nodes.
  struct Entry {
    int node;
    int q;
    Node derivative;
  };
  /// Lists derivatives of `nodes` that are not zero everywhere; returns nothing if they are too
  /// large (kMostNodes) or have a constant part that is not finite.
  static std::optional<std::vector<Entry>> list(Graph& graph, const std::vector<Node>& nodes,
                                                int shaft_count);
  static std::vector<Node> nodesOf(const std::vector<Entry>& entries);

  StateDerivatives() = default;
  StateDerivatives(Graph& graph, const std::vector<Node>& nodes, int shaft_count);

  /// The computed derivatives; all others are zero everywhere.
  const std::vector<Entry>& entries() const { return entries_; }
  bool areDifferences() const { return are_differences_; }
  /// Returns one value per entry of `entries`; valid until the next evaluation. [loop]
  const double* evaluate(const StateView& state) const;

 private:
  Tape tape_;  ///< of the entries, or of the nodes themselves where `are_differences_`
  std::vector<Entry> entries_;
  int shaft_count_ = 0;
  bool are_differences_ = false;
  mutable std::vector<double> differences_;
};

}  // namespace variator_sim::expression
