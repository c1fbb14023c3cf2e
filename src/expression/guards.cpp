#include "variator_sim/expression/guards.h"

#include <cmath>
#include <cstddef>
#include <map>
#include <memory>

#include "interval_program.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {
namespace {

/// The sign of a formula.
class SignGuard final : public Guard {
 public:
  SignGuard(const Graph& graph, Node node, bool jumps)
      : Guard(jumps), tape_(graph, {node}), enclosure_(graph, node) {}

  int branch(const StateView& state) const override {
    double value;
    tape_.evaluate(state, &value);
    return value > 0.0 ? 1 : (value < 0.0 ? -1 : kOnEdge);
  }
  bool mayLeave(const StateBox& box, int branch) const override {
    const Interval range = enclosure_.evaluate(box);
    return branch > 0 ? !(range.low > 0.0) : !(range.high < 0.0);
  }
  bool readsTime() const override { return enclosure_.readsTime(); }

 private:
  Tape tape_;
  IntervalProgram enclosure_;
};

}  // namespace

std::vector<GuardPtr> findGuards(Graph& graph, const std::vector<Node>& nodes) {
  // By the index of the node whose sign counts: whether something jumps there.
  std::map<int, bool> found;
  const std::vector<bool> reachable = graph.findReachable(nodes);
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    if (!reachable[i]) continue;
    const Graph::Entry entry = graph.entry({static_cast<int>(i)});
    Node node;
    switch (entry.operation) {
      case Operation::kAbs:
      case Operation::kSign:
        node = {entry.operands[0]};
        break;
      case Operation::kMin:
      case Operation::kMax:
        node = graph.subtract({entry.operands[0]}, {entry.operands[1]});
        break;
      default:
        continue;
    }
    if (graph.isConstant(node)) continue;
    bool& jumps = found[node.index];
    jumps = jumps || entry.operation == Operation::kSign;
  }
  std::vector<GuardPtr> guards;
  guards.reserve(found.size());
  for (const auto& [index, jumps] : found) {
    guards.push_back(std::make_shared<SignGuard>(graph, Node{index}, jumps));
  }
  return guards;
}

}  // namespace variator_sim::expression
