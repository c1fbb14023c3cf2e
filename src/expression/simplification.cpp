// The makers of nodes, which simplify.
// Every rewriting here is exact in floating point (except for the sign of a zero): it moves signs,
// drops neutral elements, or scales by powers of two.
#include <cmath>
#include <utility>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

namespace {

bool isPowerOfTwo(double value) {
  int exponent = 0;
  return std::isnormal(value) && std::abs(std::frexp(value, &exponent)) == 0.5;
}

}  // namespace

Node Graph::negate(Node a) {
  const Operation operation = entry(a).operation;
  if (operation == Operation::kNegate) return operand(a, 0);
  if (operation == Operation::kSubtract) return subtract(operand(a, 1), operand(a, 0));
  if (operation == Operation::kMultiply && isConstant(operand(a, 0))) {
    return multiply(constant(-constantValue(operand(a, 0))), operand(a, 1));
  }
  if (operation == Operation::kDivide) {
    if (isConstant(operand(a, 0))) {
      return divide(constant(-constantValue(operand(a, 0))), operand(a, 1));
    }
    if (isConstant(operand(a, 1))) {
      return divide(operand(a, 0), constant(-constantValue(operand(a, 1))));
    }
  }
  return internOperation(Operation::kNegate, a);
}

Node Graph::add(Node a, Node b) {
  if (isConstant(a, 0.0)) return b;
  if (isConstant(b, 0.0)) return a;
  if (a == b) return multiply(constant(2.0), a);
  if (entry(b).operation == Operation::kNegate) return subtract(a, operand(b, 0));
  if (entry(a).operation == Operation::kNegate) return subtract(b, operand(a, 0));
  return internOperation(Operation::kAdd, a, b);
}

Node Graph::subtract(Node a, Node b) {
  if (isConstant(b, 0.0)) return a;
  if (isConstant(a, 0.0)) return negate(b);
  if (entry(b).operation == Operation::kNegate) return add(a, operand(b, 0));
  return internOperation(Operation::kSubtract, a, b);
}

Node Graph::multiply(Node a, Node b) {
  if (isConstant(b) && !isConstant(a)) std::swap(a, b);
  if (isConstant(a, 1.0)) return b;
  if (isConstant(a, -1.0)) return negate(b);
  const bool a_negated = entry(a).operation == Operation::kNegate;
  const bool b_negated = entry(b).operation == Operation::kNegate;
  if (a_negated && b_negated) return multiply(operand(a, 0), operand(b, 0));
  if (b_negated) {
    return isConstant(a) ? multiply(constant(-constantValue(a)), operand(b, 0))
                         : negate(multiply(a, operand(b, 0)));
  }
  if (a_negated) return negate(multiply(operand(a, 0), b));
  return internOperation(Operation::kMultiply, a, b);
}

Node Graph::divide(Node a, Node b) {
  if (isConstant(b)) {
    const double divisor = constantValue(b);
    if (divisor == 1.0) return a;
    // x/c becomes x*(1/c) only where 1/c is exact.
    if (isPowerOfTwo(divisor) && std::isnormal(1.0 / divisor)) {
      return multiply(constant(1.0 / divisor), a);
    }
  }
  const bool a_negated = entry(a).operation == Operation::kNegate;
  const bool b_negated = entry(b).operation == Operation::kNegate;
  if (a_negated && b_negated) return divide(operand(a, 0), operand(b, 0));
  if (a_negated) return negate(divide(operand(a, 0), b));
  if (b_negated) return negate(divide(a, operand(b, 0)));
  return internOperation(Operation::kDivide, a, b);
}

Node Graph::power(Node base, Node exponent) {
  if (isConstant(exponent) && !isConstant(base)) {
    const double c = constantValue(exponent);
    if (c == 0.0) {
      return constant(1.0);  // also where the base is 0 or NaN, as std::pow has it
    }
    if (c == 0.5) return internOperation(Operation::kSqrt, base);
    if (c == 1.0) return base;
    if (c == -1.0) return divide(constant(1.0), base);
    if (c == 2.0) return multiply(base, base);
  }
  return internOperation(Operation::kPower, base, exponent);
}

Node Graph::select(Node left, Node right, Node yes, Node no) {
  if (yes == no) return yes;
  if (isConstant(left) && isConstant(right)) {
    const double a = constantValue(left);
    const double b = constantValue(right);
    if (a <= b || a > b) return a <= b ? yes : no;
  }
  return internOperation(Operation::kSelect, left, right, yes, no);
}

Node Graph::make(Operation operation, Node a, Node b, Node c, Node d) {
  switch (operation) {
    case Operation::kNegate:
      return negate(a);
    case Operation::kAdd:
      return add(a, b);
    case Operation::kSubtract:
      return subtract(a, b);
    case Operation::kMultiply:
      return multiply(a, b);
    case Operation::kDivide:
      return divide(a, b);
    case Operation::kPower:
      return power(a, b);
    case Operation::kSelect:
      return select(a, b, c, d);
    default:
      return internOperation(operation, a, b, c, d);
  }
}

Node Graph::remake(const Entry& it, const Node (&operands)[4]) {
  switch (it.operation) {
    case Operation::kTable:
    case Operation::kTable2:
      return table(tableOf(it), operands[0], operands[1], {it.order[0], it.order[1]});
    case Operation::kOpaque:
      return opaque(opaqueOf(it), operands);
    default:
      return make(it.operation, operands[0], operands[1], operands[2], operands[3]);
  }
}

}  // namespace variator_sim::expression
