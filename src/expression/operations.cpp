// Values of operations.
#include <cmath>
#include <limits>

#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

int operandCount(Operation operation) {
  switch (operation) {
    case Operation::kConstant:
    case Operation::kVariable:
      return 0;
    case Operation::kAdd:
    case Operation::kSubtract:
    case Operation::kMultiply:
    case Operation::kDivide:
    case Operation::kPower:
    case Operation::kAtan2:
    case Operation::kMin:
    case Operation::kMax:
    case Operation::kTable2:
    case Operation::kWhereFinite:
      return 2;
    case Operation::kOpaque:
    case Operation::kSelect:
      return 4;
    default:
      return 1;
  }
}

bool isMultipliedPower(double exponent) {
  return std::abs(exponent) <= kLargestMultipliedPower && exponent == std::trunc(exponent);
}

double signOf(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x == 0.0 ? 0.0 : x;
}

double minimumOf(double a, double b) {
  return a <= b ? a : b < a ? b : a + b;
}

double maximumOf(double a, double b) {
  return a >= b ? a : b > a ? b : a + b;
}

double whereFinite(double a, double value) {
  return std::isfinite(a) ? value : std::isinf(a) ? 0.0 : a;
}

double powerOf(double x, double exponent) {
  if (!isMultipliedPower(exponent)) {
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

// The list of operations makes this function long.
double evaluateOperation(Operation operation, const double* operands) {
  const double a = operands[0];
  switch (operation) {
    case Operation::kNegate:
      return -a;
    case Operation::kAdd:
      return a + operands[1];
    case Operation::kSubtract:
      return a - operands[1];
    case Operation::kMultiply:
      return a * operands[1];
    case Operation::kDivide:
      return a / operands[1];
    case Operation::kPower:
      return powerOf(a, operands[1]);
    case Operation::kSin:
      return std::sin(a);
    case Operation::kCos:
      return std::cos(a);
    case Operation::kTan:
      return std::tan(a);
    case Operation::kAsin:
      return std::asin(a);
    case Operation::kAcos:
      return std::acos(a);
    case Operation::kAtan:
      return std::atan(a);
    case Operation::kAtan2:
      return std::atan2(a, operands[1]);
    case Operation::kSinh:
      return std::sinh(a);
    case Operation::kCosh:
      return std::cosh(a);
    case Operation::kTanh:
      return std::tanh(a);
    case Operation::kExp:
      return std::exp(a);
    case Operation::kLog:
      return std::log(a);
    case Operation::kSqrt:
      return std::sqrt(a);
    case Operation::kAbs:
      return std::abs(a);
    case Operation::kSign:
      return signOf(a);
    case Operation::kMin:
      return minimumOf(a, operands[1]);
    case Operation::kMax:
      return maximumOf(a, operands[1]);
    case Operation::kSelect:
      return a <= operands[1]  ? operands[2]
             : a > operands[1] ? operands[3]
                               : std::numeric_limits<double>::quiet_NaN();
    case Operation::kWhereFinite:
      return whereFinite(a, operands[1]);
    case Operation::kConstant:
    case Operation::kVariable:
    case Operation::kTable:
    case Operation::kTable2:
    case Operation::kOpaque:
      break;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace variator_sim::expression
