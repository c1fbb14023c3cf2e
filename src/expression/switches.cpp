#include "variator_sim/expression/switches.h"

#include <algorithm>
#include <cstddef>

namespace variator_sim::expression {

std::vector<Node> findSwitches(Graph& graph, const std::vector<Node>& nodes) {
  std::vector<Node> switches;
  const std::vector<bool> reachable = graph.findReachable(nodes);
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    if (!reachable[i]) continue;
    const Graph::Entry entry = graph.entry({static_cast<int>(i)});
    Node found;
    switch (entry.operation) {
      case Operation::kAbs:
      case Operation::kSign:
        found = {entry.operands[0]};
        break;
      case Operation::kMin:
      case Operation::kMax:
        found = graph.subtract({entry.operands[0]}, {entry.operands[1]});
        break;
      default:
        continue;
    }
    if (graph.isConstant(found)) continue;
    if (std::find(switches.begin(), switches.end(), found) != switches.end()) continue;
    switches.push_back(found);
    if (static_cast<int>(switches.size()) == kMostSwitches) break;
  }
  return switches;
}

}  // namespace variator_sim::expression
