/// Derivatives of formulas by the whole state, and what they depend on.
#pragma once

#include <optional>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/types.h"

namespace variator_sim::expression {

/// The rates of everything a formula of a scene of `shaft_count` shafts and of inputs reads, for
/// Graph::totalDerivative: phi' = omega, omega' = epsilon, t' = 1, u' and u'' of the inputs,
/// epsilon held, as its rate is multiplied by C.
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

/// Which of time and angles occur in `nodes`, in a scene of `shaft_count` shafts.
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

/// The exact derivatives of some nodes by (phi, omega, epsilon), 3s directions q, the first s by
/// the angles. Entries that are zero by the rules of differentiation are neither stored nor
/// computed.
class StateDerivatives {
 public:
  /// Derivatives are made until the graph has grown by this many nodes: what they add to a scene's
  /// loading stays well below a second, one evaluation below a millisecond.
  static constexpr int kMostNodes = 100000;

  /// d node / d x_q, `node` being the index among the nodes.
  struct Entry {
    int node;
    int q;
    Node derivative;
  };
  /// Those of `nodes` that are not zero everywhere; nothing when they are too large to be made
  /// (kMostNodes) or have a constant part that is not finite.
  static std::optional<std::vector<Entry>> list(Graph& graph, const std::vector<Node>& nodes,
                                                int shaft_count);

  /// The derivatives of at most kMaxShafts + 1 `nodes`; nothing when `list` has none or they are
  /// beyond the limit of Tape.
  static std::optional<StateDerivatives> of(Graph& graph, const std::vector<Node>& nodes,
                                            int shaft_count);

  static std::vector<Node> nodesOf(const std::vector<Entry>& entries) {
    std::vector<Node> nodes;
    nodes.reserve(entries.size());
    for (const Entry& entry : entries) nodes.push_back(entry.derivative);
    return nodes;
  }

  /// Calls use(n, q, d node_n / d x_q) for each entry that is not zero everywhere. [loop]
  template <class Use>
  void evaluate(const StateView& state, Use use) const {
    double values[3 * kMaxShafts * (kMaxShafts + 1)];
    tape_.evaluate(state, values);
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      use(entries_[i].node, entries_[i].q, values[i]);
    }
  }

 private:
  Tape tape_;
  std::vector<Entry> entries_;  ///< of each output of the tape
};

inline std::optional<std::vector<StateDerivatives::Entry>> StateDerivatives::list(
    Graph& graph, const std::vector<Node>& nodes, int shaft_count) {
  std::vector<Entry> entries;
  const int most = graph.size() + kMostNodes;
  const Source parts[] = {Source::kAngle, Source::kVelocity, Source::kAcceleration};
  for (int q = 0; q < 3 * shaft_count; ++q) {
    const int slot = slotOf(parts[q / shaft_count], q % shaft_count);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const Node derivative = graph.differentiate(nodes[n], slot);
      if (graph.size() > most) return std::nullopt;
      if (graph.isConstant(derivative, 0.0)) continue;
      entries.push_back({static_cast<int>(n), q, derivative});
    }
  }
  if (graph.hasNonFiniteConstant(nodesOf(entries))) return std::nullopt;
  return entries;
}

inline std::optional<StateDerivatives> StateDerivatives::of(Graph& graph,
                                                            const std::vector<Node>& nodes,
                                                            int shaft_count) {
  std::optional<std::vector<Entry>> entries = list(graph, nodes, shaft_count);
  if (!entries) return std::nullopt;
  StateDerivatives made;
  try {
    made.tape_ = Tape(graph, nodesOf(*entries));
  } catch (const std::length_error&) {
    return std::nullopt;
  }
  made.entries_ = std::move(*entries);
  return made;
}

}  // namespace variator_sim::expression
