#include "variator_sim/expression/expression.h"

namespace variator_sim {
namespace {

using expression::Graph;
using expression::Node;

/// Returns the result of `make` in the graph of `expressions`. For constants, which have none, a
/// temporary graph computes it as run time would.
template <class Make, class... Expressions>
Expression makeIn(const Make& make, const Expressions&... expressions) {
  Graph* graph = nullptr;
  for (const Expression* one : {&expressions...}) graph = graph == nullptr ? one->graph() : graph;
  if (graph != nullptr) return {*graph, make(*graph, expressions.in(*graph)...)};
  Graph passing;
  return passing.constantValue(make(passing, expressions.in(passing)...));
}

}  // namespace

Expression apply(expression::Operation operation, const Expression& a) {
  return makeIn([&](Graph& graph, Node x) { return graph.make(operation, x); }, a);
}

Expression apply(expression::Operation operation, const Expression& a, const Expression& b) {
  return makeIn([&](Graph& graph, Node x, Node y) { return graph.make(operation, x, y); }, a, b);
}

Expression operator/(const Expression& a, const Expression& b) {
  if (b.isConstant() && !a.isConstant()) return a * Expression(1.0 / b.value());
  return apply(expression::Operation::kDivide, a, b);
}

Expression where(const Comparison& condition, const Expression& yes, const Expression& no) {
  // select has <=; a < b is the negation of b <= a.
  const Expression& left = condition.is_strict ? condition.right : condition.left;
  const Expression& right = condition.is_strict ? condition.left : condition.right;
  const Expression& holds = condition.is_strict ? no : yes;
  const Expression& fails = condition.is_strict ? yes : no;
  return makeIn(
      [](Graph& graph, Node a, Node b, Node c, Node d) { return graph.select(a, b, c, d); }, left,
      right, holds, fails);
}

}  // namespace variator_sim
