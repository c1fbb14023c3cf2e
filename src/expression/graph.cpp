#include "variator_sim/expression/graph.h"

#include <algorithm>
#include <array>
#include <boost/functional/hash.hpp>
#include <cmath>
#include <cstring>
#include <queue>

#include "expression/opaque_slope.h"
#include "variator_sim/interruption.h"

namespace variator_sim::expression {

namespace {

/// Returns all of an entry as integers: the value by its bits, so that 0 and -0 differ and NaN
/// equals itself.
std::array<std::uint64_t, 9> keyOf(const Graph::Entry& entry) {
  std::uint64_t value = 0;
  std::memcpy(&value, &entry.value, sizeof value);
  const auto word = [](int n) { return static_cast<std::uint64_t>(n); };
  const int(&operands)[4] = entry.operands;
  return {word(static_cast<int>(entry.operation)),
          word(operands[0]),
          word(operands[1]),
          word(operands[2]),
          word(operands[3]),
          word(entry.slot),
          value,
          word(entry.order[0]),
          word(entry.order[1])};
}

/// Returns the index of `table` (or of a function) in `tables`, and adds a new one.
template <class T>
int indexIn(std::vector<std::shared_ptr<const T>>& tables, const std::shared_ptr<const T>& table) {
  const auto found = std::find(tables.begin(), tables.end(), table);
  const auto index = static_cast<int>(found - tables.begin());
  if (found == tables.end()) tables.push_back(table);
  return index;
}

}  // namespace

std::size_t Graph::EntryHash::operator()(const Entry& entry) const {
  const auto key = keyOf(entry);
  return boost::hash_range(key.begin(), key.end());
}

bool Graph::EntryEqual::operator()(const Entry& a, const Entry& b) const {
  return keyOf(a) == keyOf(b);
}

Node Graph::intern(const Entry& entry) {
  constexpr std::size_t kBetween = 256;  // entries between two checks of the clock
  if (entries_.size() % kBetween == 0) endIfInterrupted();
  const auto [position, is_new] = index_of_.emplace(entry, size());
  if (is_new) {
    entries_.push_back(entry);
    traits_.push_back(findTraits(entry));
  }
  return {position->second};
}

Node Graph::internOperation(Operation operation, Node a, Node b, Node c, Node d) {
  const Node nodes[4] = {a, b, c, d};
  const int count = operandCount(operation);
  bool all_constant = true;
  double values[4] = {};
  Entry entry;
  entry.operation = operation;
  for (int i = 0; i < count; ++i) {
    entry.operands[i] = nodes[i].index;
    all_constant = all_constant && isConstant(nodes[i]);
    values[i] = isConstant(nodes[i]) ? constantValue(nodes[i]) : 0.0;
  }
  if (all_constant) return constant(evaluateOperation(operation, values));
  if (operation == Operation::kAdd || operation == Operation::kMultiply) {
    // Both operands are sorted: constants first, then by age.
    const bool swap =
        isConstant(a) != isConstant(b) ? isConstant(b) : entry.operands[0] > entry.operands[1];
    if (swap) std::swap(entry.operands[0], entry.operands[1]);
  }
  return intern(entry);
}

Node Graph::constant(double value) {
  Entry entry;
  entry.value = value;
  return intern(entry);
}

Node Graph::variable(int slot) {
  Entry entry;
  entry.operation = Operation::kVariable;
  entry.slot = slot;
  return intern(entry);
}

Node Graph::table(const std::shared_ptr<const Table>& table, Node x, Node y, Table::Order order) {
  const bool has_two = table->argumentCount() == 2;
  if (std::max(order.x, order.y) > table->degree()) return constant(0.0);
  if (isConstant(x) && (!has_two || isConstant(y))) {
    return constant(has_two ? table->derivative(order, constantValue(x), constantValue(y))
                            : table->derivative(order.x, constantValue(x)));
  }
  Entry entry;
  entry.operation = has_two ? Operation::kTable2 : Operation::kTable;
  entry.operands[0] = x.index;
  if (has_two) entry.operands[1] = y.index;
  entry.slot = indexIn(tables_, table);
  entry.order[0] = order.x;
  entry.order[1] = order.y;
  return intern(entry);
}

Node Graph::opaque(const std::shared_ptr<const OpaqueFunction>& function,
                   const Node (&arguments)[4]) {
  const int count = function->argumentCount();
  Entry entry;
  entry.operation = Operation::kOpaque;
  double x[4] = {};
  bool all_constant = true;
  for (int i = 0; i < 4; ++i) {
    const Node argument = arguments[std::min(i, count - 1)];
    entry.operands[i] = argument.index;
    if (isConstant(argument)) x[i] = constantValue(argument);
    all_constant = all_constant && isConstant(argument);
  }
  if (all_constant) return constant(function->value(x));
  entry.slot = indexIn(functions_, function);
  return intern(entry);
}

Node Graph::substitute(Node node, const std::vector<Rate>& values) {
  std::vector<Node> made(static_cast<std::size_t>(node.index) + 1);
  for (const int i : listReachable({node})) {
    const Entry it = entry({i});  // a copy: making nodes moves the entries
    Node& here = made[static_cast<std::size_t>(i)];
    here = {i};
    if (it.operation == Operation::kVariable) {
      for (const Rate& value : values) here = value.first == it.slot ? value.second : here;
      continue;
    }
    Node operands[4];
    bool is_same = true;
    for (int k = 0; k < operandCount(it.operation); ++k) {
      operands[k] = made[static_cast<std::size_t>(it.operands[k])];
      is_same = is_same && operands[k].index == it.operands[k];
    }
    if (!is_same) here = remake(it, operands);
  }
  return made[static_cast<std::size_t>(node.index)];
}

std::vector<int> Graph::listReachable(const std::vector<Node>& nodes) const {
  endIfInterrupted();
  // Operands have smaller indices: all users of the node with the largest index are known.
  std::priority_queue<int> waiting;
  for (const Node node : nodes) waiting.push(node.index);
  std::vector<int> reachable;
  while (!waiting.empty()) {
    const int largest = waiting.top();
    waiting.pop();
    if (!reachable.empty() && reachable.back() == largest) continue;
    reachable.push_back(largest);
    const Entry& it = entry({largest});
    for (int k = 0; k < operandCount(it.operation); ++k) waiting.push(it.operands[k]);
  }
  std::reverse(reachable.begin(), reachable.end());
  return reachable;
}

template <class Is>
bool Graph::anyReachable(const std::vector<Node>& nodes, Is is) const {
  const std::vector<int> reachable = listReachable(nodes);
  return std::any_of(reachable.begin(), reachable.end(), [&](int i) { return is(entry({i})); });
}

bool Graph::dependsOn(const std::vector<Node>& nodes, int slot) const {
  return anyReachable(nodes, [&](const Entry& it) {
    return it.operation == Operation::kVariable && it.slot == slot;
  });
}

bool Graph::hasOpaque(const std::vector<Node>& nodes) const {
  return anyReachable(nodes, [](const Entry& it) { return it.operation == Operation::kOpaque; });
}

bool Graph::hasDifference(const std::vector<Node>& nodes) const {
  return anyReachable(nodes, [&](const Entry& it) {
    return it.operation == Operation::kOpaque && OpaqueSlope::countIn(*opaqueOf(it)) > 1;
  });
}

bool Graph::hasNonFiniteConstant(const std::vector<Node>& nodes) const {
  return anyReachable(nodes, [](const Entry& it) { return !std::isfinite(it.value); });
}

}  // namespace variator_sim::expression
