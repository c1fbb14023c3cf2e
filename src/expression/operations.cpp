// Values of operations, and the functions that formulas call.
#include "expression/operations.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <vector>

#include "expression/characters.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim::expression {

double powerOf(double x, double exponent) {
  constexpr double kLargestMultiplied = 16.0;
  if (std::abs(exponent) > kLargestMultiplied || exponent != std::trunc(exponent)) {
    return exponent == 0.5 ? std::sqrt(x) : std::pow(x, exponent);
  }
  if (exponent < 0.0) return 1.0 / powerOf(x, -exponent);
  const int n = static_cast<int>(exponent);
  if (n <= 1) return n == 0 ? 1.0 : x;
  if (n % 2 == 1) return powerOf(x, n - 1) * x;
  const int half = n / 2;
  const double root = powerOf(x, half);
  return root * root;
}

namespace {

using Operands = const double*;

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

constexpr Function kRules[] = {
    {Operation::kConstant, 0, nullptr},
    {Operation::kVariable, 0, nullptr},
    {Operation::kNegate, 1, [](Operands x) { return -x[0]; }},
    {Operation::kAdd, 2, [](Operands x) { return x[0] + x[1]; }},
    {Operation::kSubtract, 2, [](Operands x) { return x[0] - x[1]; }},
    {Operation::kMultiply, 2, [](Operands x) { return x[0] * x[1]; }},
    {Operation::kDivide, 2, [](Operands x) { return x[0] / x[1]; }},
    {Operation::kPower, 2, [](Operands x) { return powerOf(x[0], x[1]); }, "pow", ""},
    {Operation::kSin, 1, [](Operands x) { return std::sin(x[0]); }, "sin", "\\sin"},
    {Operation::kCos, 1, [](Operands x) { return std::cos(x[0]); }, "cos", "\\cos"},
    {Operation::kTan, 1, [](Operands x) { return std::tan(x[0]); }, "tan", "\\tan"},
    {Operation::kAsin, 1, [](Operands x) { return std::asin(x[0]); }, "asin", "\\arcsin"},
    {Operation::kAcos, 1, [](Operands x) { return std::acos(x[0]); }, "acos", "\\arccos"},
    {Operation::kAtan, 1, [](Operands x) { return std::atan(x[0]); }, "atan", "\\arctan"},
    {Operation::kAtan2, 2, [](Operands x) { return std::atan2(x[0], x[1]); }, "atan2",
     "\\operatorname{atan2}"},
    {Operation::kSinh, 1, [](Operands x) { return std::sinh(x[0]); }, "sinh", "\\sinh"},
    {Operation::kCosh, 1, [](Operands x) { return std::cosh(x[0]); }, "cosh", "\\cosh"},
    {Operation::kTanh, 1, [](Operands x) { return std::tanh(x[0]); }, "tanh", "\\tanh"},
    {Operation::kExp, 1, [](Operands x) { return std::exp(x[0]); }, "exp", "\\exp"},
    {Operation::kLog, 1, [](Operands x) { return std::log(x[0]); }, "log", "\\ln"},
    {Operation::kSqrt, 1, [](Operands x) { return std::sqrt(x[0]); }, "sqrt", ""},
    {Operation::kAbs, 1, [](Operands x) { return std::abs(x[0]); }, "abs", ""},
    {Operation::kSign, 1, [](Operands x) { return signOf(x[0]); }, "sign", "\\operatorname{sgn}"},
    {Operation::kMin, 2, [](Operands x) { return minimumOf(x[0], x[1]); }, "min", "\\min"},
    {Operation::kMax, 2, [](Operands x) { return maximumOf(x[0], x[1]); }, "max", "\\max"},
    {Operation::kTable, 1, nullptr},
    {Operation::kTable2, 2, nullptr},
    {Operation::kOpaque, 4, nullptr},
    {Operation::kSelect, 4, [](Operands x) { return selectOf(x[0], x[1], x[2], x[3]); }, "if", ""},
    {Operation::kWhereFinite, 2, [](Operands x) { return whereFinite(x[0], x[1]); }}};

constexpr const Function& ruleOf(Operation operation) {
  return kRules[static_cast<std::size_t>(operation)];
}

constexpr bool areInOrder() {
  for (const Function& it : kRules)
    if (&ruleOf(it.operation) != &it) return false;
  return true;
}
static_assert(areInOrder(), "a rule stands at its operation's number");

constexpr Function kClamp = {Operation::kConstant, 3, nullptr, "clamp", ""};

}  // namespace

int operandCount(Operation operation) {
  return ruleOf(operation).operand_count;
}

double evaluateOperation(Operation operation, const double* operands) {
  return ruleOf(operation).value(operands);
}

const Function* findFunction(const std::string& name) {
  if (name == kClamp.name) return &kClamp;
  const auto* const it = std::find_if(std::begin(kRules), std::end(kRules), [&](const auto& one) {
    return !name.empty() && name == one.name;
  });
  return it == std::end(kRules) ? nullptr : it;
}

const Function& functionOf(Operation operation) {
  return ruleOf(operation);
}

std::vector<std::string> functionNames() {
  std::vector<std::string> names = {kClamp.name};
  for (const Function& it : kRules)
    if (*it.name != 0) names.emplace_back(it.name);
  std::sort(names.begin(), names.end());
  return names;
}

std::string explainForeignWord(const std::string& word) {
  struct Foreign {
    std::vector<std::string> words;
    const char* way;
  };
  static const Foreign kForeign[] = {
      {{"and", "&", "or", "|"},
       "'if' takes one comparison; both hold in if(a < b, if(c < d, x, y), y), one or both in "
       "if(a < b, x, if(c < d, x, y))"},
      {{"not", "!"}, "the opposite of a comparison exchanges the two values of its 'if'"},
      {{"delay", "delayed", "transport_delay"},
       "the value of x from 0.2 s ago is delay(x, 0.2), in formulas of scenes"},
      {{"integral", "integrate", "integ", "int", "cumsum"},
       "the integral of a speed is an angle, phi_SHAFT; that of anything else is a state of the "
       "scene, states: [z] with z: {rate: FORMULA} (doc/scene.md); over a run it is the metric "
       "integral(COLUMN) of a sweep"}};
  for (const Foreign& it : kForeign) {
    if (std::count(it.words.begin(), it.words.end(), word) > 0) return it.way;
  }
  return "";
}

bool isValidName(const std::string& name) {
  return !name.empty() && isNameStart(name.front()) &&
         std::all_of(name.begin(), name.end(), [](char c) { return isNameStart(c) || isDigit(c); });
}

}  // namespace variator_sim::expression
