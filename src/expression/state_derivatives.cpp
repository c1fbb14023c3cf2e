#include "variator_sim/expression/state_derivatives.h"

#include "model/central_difference.h"

namespace variator_sim::expression {

std::optional<std::vector<StateDerivatives::Entry>> StateDerivatives::list(
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

std::vector<Node> StateDerivatives::nodesOf(const std::vector<Entry>& entries) {
  std::vector<Node> nodes;
  nodes.reserve(entries.size());
  for (const Entry& entry : entries) nodes.push_back(entry.derivative);
  return nodes;
}

StateDerivatives::StateDerivatives(Graph& graph, const std::vector<Node>& nodes, int shaft_count)
    : shaft_count_(shaft_count) {
  if (std::optional<std::vector<Entry>> exact = list(graph, nodes, shaft_count)) {
    tape_ = Tape(graph, nodesOf(*exact));
    entries_ = std::move(*exact);
    return;
  }
  are_differences_ = true;
  tape_ = Tape(graph, nodes);
  for (int q = 0; q < 3 * shaft_count; ++q) {
    for (int n = 0; n < tape_.outputCount(); ++n) entries_.push_back({n, q, Node{}});
  }
  differences_.resize(2 * entries_.size());
}

const double* StateDerivatives::evaluate(const StateView& state) const {
  if (!are_differences_) return tape_.evaluate(state);
  const int count = tape_.outputCount();
  // (f(x + h e_q) - f(x - h e_q)) / 2h, behind them f(x + h e_q)
  forEachShift(state, shaft_count_,
               [&](int q, const StateView& above, const StateView& below, double width) {
                 double* const upper = differences_.data() + entries_.size();
                 double* const difference = differences_.data() + q * count;
                 tape_.evaluate(above, upper);
                 const double* const lower = tape_.evaluate(below);
                 for (int n = 0; n < count; ++n) difference[n] = (upper[n] - lower[n]) / width;
               });
  return differences_.data();
}

}  // namespace variator_sim::expression
