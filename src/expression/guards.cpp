#include "variator_sim/expression/guards.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "variator_sim/expression/tape.h"

namespace variator_sim {
namespace expression {
namespace {

/// A function with branches, as formulas write it. Functions that jump come last.
struct Branching {
  Operation operation;
  const char* function;
  bool jumps;
};
constexpr Branching kBranching[] = {{Operation::kAbs, "abs", false},
                                    {Operation::kMin, "min", false},
                                    {Operation::kMax, "max", false},
                                    {Operation::kSign, "sign", true},
                                    {Operation::kSelect, "if", true}};

}  // namespace

std::vector<Passage> findPassages(const Graph& graph, const std::vector<Node>& nodes) {
  std::set<std::tuple<int, std::vector<double>, int>> found;
  for (const int i : graph.listReachable(nodes)) {
    const Graph::Entry& entry = graph.entry({i});
    if (entry.operation != Operation::kTable && entry.operation != Operation::kTable2) continue;
    const Table& table = *graph.tableOf(entry);
    for (int axis = 0; axis < table.argumentCount(); ++axis) {
      found.emplace(entry.operands[axis], table.points(axis), table.smoothness());
    }
  }
  std::vector<Passage> passages;
  for (const auto& [argument, points, smoothness] : found) {
    if (graph.isConstant(Node{argument})) continue;
    passages.push_back({Node{argument}, points, smoothness});
  }
  return passages;
}

std::vector<Branch> findBranches(Graph& graph, const std::vector<Node>& nodes) {
  // Key: the index of the node whose sign decides; value: the last such entry of kBranching.
  std::map<int, const Branching*> found;
  for (const int i : graph.listReachable(nodes)) {
    const Graph::Entry entry = graph.entry({i});
    const auto* const it =
        std::find_if(std::begin(kBranching), std::end(kBranching),
                     [&](const Branching& one) { return one.operation == entry.operation; });
    if (it == std::end(kBranching)) continue;
    const Node first{entry.operands[0]};
    const Node node =
        operandCount(entry.operation) == 1 ? first : graph.subtract(first, {entry.operands[1]});
    if (graph.isConstant(node)) continue;
    const Branching*& known = found.emplace(node.index, it).first->second;
    known = std::max(known, it);
  }
  std::vector<Branch> branches;
  branches.reserve(found.size());
  for (const auto& [index, it] : found) branches.push_back({Node{index}, it->function, it->jumps});
  return branches;
}

std::size_t countSwitchingFunctions(Graph& graph, const std::vector<Node>& nodes) {
  const std::vector<Passage> passages = findPassages(graph, nodes);
  const auto switches = [&](const Passage& it) {
    const Graph::Entry& entry = graph.entry(it.argument);
    const bool is_time =
        entry.operation == Operation::kVariable && entry.slot == slotOf(Source::kTime);
    return !is_time || it.smoothness != 3;
  };
  return findBranches(graph, nodes).size() +
         static_cast<std::size_t>(std::count_if(passages.begin(), passages.end(), switches));
}

}  // namespace expression
}  // namespace variator_sim
