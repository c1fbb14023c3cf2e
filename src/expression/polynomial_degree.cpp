#include <algorithm>
#include <unordered_map>
#include <vector>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

namespace {

constexpr int kNone = 1 << 20;

int degreeOfPower(const Graph& graph, int base, Node exponent) {
  if (!graph.isConstant(exponent)) return kNone;
  const double n = graph.constantValue(exponent);
  if (!(n >= 0.0) || !isMultipliedPower(n)) return kNone;
  return std::min(kNone, base * static_cast<int>(n));
}

}  // namespace

int Graph::polynomialDegree(Node node, const std::vector<int>& slots) const {
  std::unordered_map<int, int> degrees;
  for (const int index : listReachable({node})) {
    const Entry& it = entry({index});
    int of[4] = {};
    const int count = operandCount(it.operation);
    for (int i = 0; i < count; ++i) of[i] = degrees.at(it.operands[i]);
    const int highest = *std::max_element(of, of + 4);
    int degree = highest == 0 ? 0 : kNone;
    switch (it.operation) {
      case Operation::kVariable:
        degree = std::find(slots.begin(), slots.end(), it.slot) == slots.end() ? 0 : 1;
        break;
      case Operation::kNegate:
      case Operation::kAdd:
      case Operation::kSubtract:
        degree = highest;
        break;
      case Operation::kMultiply:
        degree = std::min(kNone, of[0] + of[1]);
        break;
      case Operation::kDivide:
        if (of[1] == 0) degree = of[0];
        break;
      case Operation::kPower:
        if (highest > 0 && of[1] == 0) degree = degreeOfPower(*this, of[0], {it.operands[1]});
        break;
      case Operation::kSelect:
        if (of[0] == 0 && of[1] == 0) degree = highest;
        break;
      default:
        break;
    }
    degrees[index] = degree;
  }
  const int degree = degrees.at(node.index);
  return degree < kNone ? degree : -1;
}

}  // namespace variator_sim::expression
