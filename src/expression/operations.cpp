// Values of operations.
#include <cmath>
#include <limits>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

double powerOf(double x, double exponent) {
  constexpr double kLargestMultiplied = 16.0;
  if (std::abs(exponent) > kLargestMultiplied || exponent != std::trunc(exponent)) {
    return exponent == 0.5 ? std::sqrt(x) : std::pow(x, exponent);
  }
  if (exponent < 0.0) {
    return 1.0 / powerOf(x, -exponent);
  }
  const int n = static_cast<int>(exponent);
  if (n <= 1) {
    return n == 0 ? 1.0 : x;
  }
  if (n % 2 == 1) {
    return powerOf(x, n - 1) * x;
  }
  const int half = n / 2;
  const double root = powerOf(x, half);
  return root * root;
}

namespace {

// A comparison with NaN is undecided, so its result is NaN (std::min may drop it).
double signOf(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x == 0.0 ? 0.0 : x;
}
double minimumOf(double a, double b) {
  return a <= b ? a : b < a ? b : a + b;
}
double maximumOf(double a, double b) {
  return a >= b ? a : b > a ? b : a + b;
}
double selectOf(double a, double b, double yes, double no) {
  return a <= b ? yes : a > b ? no : std::numeric_limits<double>::quiet_NaN();
}
double whereFinite(double a, double value) {
  return std::isfinite(a) ? value : std::isinf(a) ? 0.0 : a;
}

using Operands = const double*;

struct Rule {
  Operation operation;
  int operand_count;
  double (*value)(Operands x);  ///< null for what reads more than its operands
};
constexpr Rule kRules[] = {
    {Operation::kConstant, 0, nullptr},
    {Operation::kVariable, 0, nullptr},
    {Operation::kNegate, 1, [](Operands x) { return -x[0]; }},
    {Operation::kAdd, 2, [](Operands x) { return x[0] + x[1]; }},
    {Operation::kSubtract, 2, [](Operands x) { return x[0] - x[1]; }},
    {Operation::kMultiply, 2, [](Operands x) { return x[0] * x[1]; }},
    {Operation::kDivide, 2, [](Operands x) { return x[0] / x[1]; }},
    {Operation::kPower, 2, [](Operands x) { return powerOf(x[0], x[1]); }},
    {Operation::kSin, 1, [](Operands x) { return std::sin(x[0]); }},
    {Operation::kCos, 1, [](Operands x) { return std::cos(x[0]); }},
    {Operation::kTan, 1, [](Operands x) { return std::tan(x[0]); }},
    {Operation::kAsin, 1, [](Operands x) { return std::asin(x[0]); }},
    {Operation::kAcos, 1, [](Operands x) { return std::acos(x[0]); }},
    {Operation::kAtan, 1, [](Operands x) { return std::atan(x[0]); }},
    {Operation::kAtan2, 2, [](Operands x) { return std::atan2(x[0], x[1]); }},
    {Operation::kSinh, 1, [](Operands x) { return std::sinh(x[0]); }},
    {Operation::kCosh, 1, [](Operands x) { return std::cosh(x[0]); }},
    {Operation::kTanh, 1, [](Operands x) { return std::tanh(x[0]); }},
    {Operation::kExp, 1, [](Operands x) { return std::exp(x[0]); }},
    {Operation::kLog, 1, [](Operands x) { return std::log(x[0]); }},
    {Operation::kSqrt, 1, [](Operands x) { return std::sqrt(x[0]); }},
    {Operation::kAbs, 1, [](Operands x) { return std::abs(x[0]); }},
    {Operation::kSign, 1, [](Operands x) { return signOf(x[0]); }},
    {Operation::kMin, 2, [](Operands x) { return minimumOf(x[0], x[1]); }},
    {Operation::kMax, 2, [](Operands x) { return maximumOf(x[0], x[1]); }},
    {Operation::kTable, 1, nullptr},
    {Operation::kTable2, 2, nullptr},
    {Operation::kOpaque, 4, nullptr},
    {Operation::kSelect, 4, [](Operands x) { return selectOf(x[0], x[1], x[2], x[3]); }},
    {Operation::kWhereFinite, 2, [](Operands x) { return whereFinite(x[0], x[1]); }}};

constexpr const Rule& ruleOf(Operation operation) {
  return kRules[static_cast<std::size_t>(operation)];
}

constexpr bool areInOrder() {
  for (const Rule& it : kRules) {
    if (&ruleOf(it.operation) != &it) return false;
  }
  return true;
}
static_assert(areInOrder(), "a rule stands at its operation's number");

}  // namespace

int operandCount(Operation operation) {
  return ruleOf(operation).operand_count;
}

double evaluateOperation(Operation operation, const double* operands) {
  return ruleOf(operation).value(operands);
}

}  // namespace variator_sim::expression
