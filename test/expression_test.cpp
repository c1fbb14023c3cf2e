// Formulas: their values against std::, their derivatives against differences of independent
// long-double functions and against dual numbers, and what is said about texts that are none.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/count_allocations.h"
#include "support/faults.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = 3.14159265358979323846;

const int kX = slotOf(Source::kAngle, 0);
const int kY = slotOf(Source::kAngle, 1);
const int kZ = slotOf(Source::kVelocity, 0);
const int kW = slotOf(Source::kVelocity, 1);

/// A graph with the variables x, y, z, w.
struct Formulas {
  Formulas() {
    symbols["x"] = graph.variable(kX);
    symbols["y"] = graph.variable(kY);
    symbols["z"] = graph.variable(kZ);
    symbols["w"] = graph.variable(kW);
  }

  Node read(const std::string& text) { return parse(text, symbols, graph); }

  std::vector<double> evaluate(const std::vector<Node>& nodes, const std::array<double, 4>& point) {
    std::vector<double> values(nodes.size(), kNan);
    const StateView state = {kNan, &point[0], &point[2], nullptr, nullptr, nullptr};
    Tape(graph, nodes).evaluate(state, values.data());
    return values;
  }
  double evaluate(Node node, double x, double y = 0.0, double z = 0.0, double w = 0.0) {
    return evaluate(std::vector<Node>{node}, {x, y, z, w}).front();
  }

  Graph graph;
  SymbolTable symbols;
};

double valueOf(const std::string& text, double x = 0.0, double y = 0.0, double z = 0.0,
               double w = 0.0) {
  Formulas formulas;
  return formulas.evaluate(formulas.read(text), x, y, z, w);
}

/// Bit by bit, but for the sign of zero; all NaN are one.
void expectSame(double actual, double expected, const std::string& what) {
  if (std::isnan(expected)) {
    EXPECT_TRUE(std::isnan(actual)) << what << " is " << actual;
  } else {
    EXPECT_EQ(actual, expected) << what;
  }
}

ExpressionError errorOf(const std::string& text) {
  Formulas formulas;
  try {
    formulas.read(text);
  } catch (const ExpressionError& error) {
    return error;
  }
  ADD_FAILURE() << "no error in " << text.substr(0, 80);
  return {"", "", 0};
}

// ------------------------------------------------------------------------------------------ values

TEST(ExpressionValues, FunctionsAreThoseOfTheStandardLibrary) {
  using Reference = double (*)(double);
  const std::vector<std::pair<std::string, Reference>> functions = {
      {"sin", std::sin},   {"cos", std::cos},   {"tan", std::tan},   {"asin", std::asin},
      {"acos", std::acos}, {"atan", std::atan}, {"sinh", std::sinh}, {"cosh", std::cosh},
      {"tanh", std::tanh}, {"exp", std::exp},   {"log", std::log},   {"sqrt", std::sqrt},
      {"abs", std::abs}};
  for (const auto& [name, reference] : functions) {
    for (const double x :
         {-30.0, -1.0, -0.3, 0.0, 0.25, 0.9, 1.0, 2.5, 700.0, 1e300, kInfinity, -kInfinity, kNan}) {
      expectSame(valueOf(name + "(x)", x), reference(x), name + " of " + std::to_string(x));
    }
    // Constants are computed as run time does.
    expectSame(valueOf(name + "(0.25)"), reference(0.25), name);
  }
  for (const double x : {-2.0, 0.5, 3.0}) {
    for (const double y : {-1.5, 0.25, 4.0}) {
      expectSame(valueOf("atan2(x, y)", x, y), std::atan2(x, y), "atan2");
      expectSame(valueOf("min(x, y)", x, y), std::min(x, y), "min");
      expectSame(valueOf("max(x, y)", x, y), std::max(x, y), "max");
      expectSame(valueOf("pow(x, y)", x, y), std::pow(x, y), "pow");
      expectSame(valueOf("x^y", x, y), std::pow(x, y), "^");
      expectSame(valueOf("x + y", x, y), x + y, "+");
      expectSame(valueOf("x - y", x, y), x - y, "-");
      expectSame(valueOf("x*y", x, y), x * y, "*");
      expectSame(valueOf("x/y", x, y), x / y, "/");
    }
  }
  EXPECT_EQ(valueOf("pi"), kPi);
}

TEST(ExpressionValues, SignMinAndMaxAtTheirEdges) {
  EXPECT_EQ(valueOf("sign(x)", -3.0), -1.0);
  EXPECT_EQ(valueOf("sign(x)", 0.0), 0.0);
  EXPECT_EQ(valueOf("sign(x)", 1e-300), 1.0);
  for (const std::string text : {"sign(x)", "min(x, y)", "min(y, x)", "max(x, y)", "max(y, x)"}) {
    EXPECT_TRUE(std::isnan(valueOf(text, kNan, 1.0))) << text << " must not lose a NaN";
  }
  EXPECT_EQ(valueOf("min(x, y)", 2.0, 2.0), 2.0);
  EXPECT_EQ(valueOf("max(x, y)", -kInfinity, kInfinity), kInfinity);
}

constexpr std::array<char, 4> kOperators = {'+', '-', '*', '/'};
double apply(char o, double a, double b) {
  // volatile: no contraction of this side either
  const volatile double value = o == '+' ? a + b : o == '-' ? a - b : o == '*' ? a * b : a / b;
  return value;
}

TEST(ExpressionValues, EveryFusedInstructionRoundsLikeItsOperations) {
  const double x = 0.1;
  const double y = 1.7;
  const double z = -2.3;
  const double w = 0.7;
  for (const char o1 : kOperators) {
    const std::string pair = std::string("(x") + o1 + "y)";
    const double t = apply(o1, x, y);
    expectSame(valueOf(pair, x, y), t, pair);
    expectSame(valueOf("-" + pair, x, y), -t, "-" + pair);
    for (const char o2 : kOperators) {
      expectSame(valueOf(pair + o2 + "z", x, y, z), apply(o2, t, z), pair + o2 + "z");
      expectSame(valueOf(std::string("z") + o2 + pair, x, y, z), apply(o2, z, t),
                 std::string("z") + o2 + pair);
      for (const char o3 : kOperators) {
        const std::string quad = pair + o2 + "(z" + o3 + "w)";
        expectSame(valueOf(quad, x, y, z, w), apply(o2, t, apply(o3, z, w)), quad);
      }
    }
  }
}

TEST(ExpressionValues, AreTheSameHoweverManyOfOneKindThereAre) {
  const std::array<double, 4> point = {0.1, 1.7, -2.3, 0.7};
  for (int count = 1; count <= 9; ++count) {
    for (const char o1 : kOperators) {
      for (const char o2 : kOperators) {
        Formulas formulas;
        std::vector<Node> nodes;
        std::vector<double> expected;
        for (int i = 1; i <= count; ++i) {
          const std::string number = std::to_string(i) + ".1";
          nodes.push_back(formulas.read("x" + (o1 + number)));
          expected.push_back(apply(o1, point[0], std::stod(number)));
          nodes.push_back(formulas.read("(y" + (o1 + number) + ")" + o2 + "z"));
          expected.push_back(apply(o2, apply(o1, point[1], std::stod(number)), point[2]));
          nodes.push_back(
              formulas.read("(z" + (o1 + number) + ")" + o2 + "(w" + o1 + number + ")"));
          expected.push_back(apply(o2, apply(o1, point[2], std::stod(number)),
                                   apply(o1, point[3], std::stod(number))));
        }
        EXPECT_EQ(formulas.evaluate(nodes, point), expected) << count << " of " << o1 << o2;
      }
    }
  }
}

TEST(ExpressionValues, OfOneKindMayNeedOneAnother) {
  Formulas formulas;
  std::vector<Node> powers = {formulas.read("x*y")};
  std::vector<double> expected = {1.1 * 0.7};
  for (int i = 1; i < 11; ++i) {
    powers.push_back(formulas.graph.multiply(powers.back(), formulas.read("y")));
    expected.push_back(expected.back() * 0.7);
  }
  std::reverse(powers.begin(), powers.end());
  std::reverse(expected.begin(), expected.end());
  EXPECT_EQ(formulas.evaluate(powers, {1.1, 0.7, 0.0, 0.0}), expected);
}

TEST(ExpressionValues, SineAndCosineHaveTheBitsOfTheLibrarys) {
  Formulas formulas;
  const std::vector<Node> both = {formulas.read("sin(x)"), formulas.read("cos(x)")};
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> exponent(-10.0, 10.0);
  for (int i = 0; i < 2000; ++i) {
    const double x = std::pow(10.0, exponent(generator)) * (i % 2 == 0 ? 1.0 : -1.0);
    const std::vector<double> values = formulas.evaluate(both, {x, 0.0, 0.0, 0.0});
    ASSERT_EQ(values[0], std::sin(x)) << x;
    ASSERT_EQ(values[1], std::cos(x)) << x;
  }
}

TEST(ExpressionValues, IntegerPowersAreExactWhereTheProductsAre) {
  for (const double x : {-3.0, -1.0, 0.0, 0.5, 2.0}) {
    for (int n = -16; n <= 17; ++n) {
      const std::string text = "x^" + std::to_string(n);
      expectSame(valueOf(text, x), std::pow(x, n), text + " at " + std::to_string(x));
    }
  }
  for (int n = -16; n <= 16; ++n) {
    const double reference = std::pow(1.1, n);
    EXPECT_NEAR(valueOf("x^" + std::to_string(n), 1.1), reference,
                std::abs(n) * 1.2e-16 * std::abs(reference));
  }
  EXPECT_EQ(valueOf("x^0", kNan), 1.0);  // as std::pow
  EXPECT_EQ(valueOf("x^0.5", 2.0), std::sqrt(2.0));
  EXPECT_EQ(valueOf("sqrt(x)", 0.0), 0.0);
}

struct PrecedenceRow {
  const char* text;
  double value;
};

TEST(ExpressionValues, PrecedenceAndAssociativity) {
  const double x = 2.0;
  const double y = 3.0;
  const double z = 5.0;
  const PrecedenceRow rows[] = {
      {"x - y - z", x - y - z},
      {"x - (y - z)", x - (y - z)},
      {"x/y/z", x / y / z},
      {"x/y*z", x / y * z},
      {"x + y*z", x + y * z},
      {"(x + y)*z", (x + y) * z},
      {"-x^2", -(x * x)},
      {"(-x)^2", x * x},
      {"2^-3", 0.125},
      {"2^-x", 0.25},
      {"x^y^2", 512.0},
      {"(x^y)^2", 64.0},
      {"2^-1^2", 0.5},
      {"2^-x^2", 0.0625},
      {"-2^-2", -0.25},
      {"x--y", x + y},
      {"x-+-y", x + y},
      {"x*-y", -6.0},
      {"x/-y", -x / y},
      {"-x*y", -6.0},
      {"+x", x},
      {"- - x", x},
      {"---x", -x},
      {"2*x^2*y", 24.0},
      {"x^2/y", 4.0 / 3.0},
      {" \t( x )\n*\r( y ) ", 6.0},
      {"((((x))))", x},
      {"min(x, max(y, z)) + 1", 3.0},
      {"atan2(-x, y)", std::atan2(-x, y)},
      {"sin(x)^2 + cos(x)^2", std::sin(x) * std::sin(x) + std::cos(x) * std::cos(x)},
      {"2*pi", 2.0 * kPi},
      {"1 + 1. + .5 + 1e-9 + 1E+3 + 2.5e1 + 1.e0", 1 + 1. + .5 + 1e-9 + 1E+3 + 2.5e1 + 1.e0},
      {"0.1", 0.1},
      {"9007199254740993", 9007199254740993.0},
      {"2.2250738585072011e-308", 2.2250738585072011e-308},
  };
  for (const PrecedenceRow& row : rows) {
    expectSame(valueOf(row.text, x, y, z), row.value, row.text);
  }
}

// ------------------------------------------------------------------------------------- derivatives

using Real = long double;
using Function = std::function<Real(Real)>;

/// Central differences of order 8.
Real difference(const Function& f, Real x, Real h = 1e-3L) {
  return (4.0L / 5.0L * (f(x + h) - f(x - h)) - 1.0L / 5.0L * (f(x + 2 * h) - f(x - 2 * h)) +
          4.0L / 105.0L * (f(x + 3 * h) - f(x - 3 * h)) -
          1.0L / 280.0L * (f(x + 4 * h) - f(x - 4 * h))) /
         h;
}

struct DerivativeRow {
  const char* text;
  Function function;
  std::vector<double> points;
};

TEST(ExpressionDerivatives, OfEveryFunctionAgreeWithDifferences) {
  const DerivativeRow rows[] = {
      {"sin(2*x)", [](Real x) { return std::sin(2 * x); }, {-1.0, 0.0, 0.4, 3.0}},
      {"cos(3*x)", [](Real x) { return std::cos(3 * x); }, {-1.0, 0.0, 0.4, 3.0}},
      {"tan(x)", [](Real x) { return std::tan(x); }, {-1.0, 0.0, 0.4}},
      {"asin(x/2)", [](Real x) { return std::asin(x / 2); }, {-1.0, 0.0, 1.5}},
      {"acos(x/2)", [](Real x) { return std::acos(x / 2); }, {-1.0, 0.0, 1.5}},
      {"atan(x)", [](Real x) { return std::atan(x); }, {-3.0, 0.0, 1.5}},
      {"atan2(x, 2)", [](Real x) { return std::atan2(x, 2.0L); }, {-3.0, 0.0, 1.5}},
      {"atan2(3, x)", [](Real x) { return std::atan2(3.0L, x); }, {-3.0, 0.0, 1.5}},
      {"atan2(x^2, x+1)", [](Real x) { return std::atan2(x * x, x + 1); }, {0.3, 1.5}},
      {"sinh(x)", [](Real x) { return std::sinh(x); }, {-1.0, 0.0, 2.0}},
      {"cosh(x)", [](Real x) { return std::cosh(x); }, {-1.0, 0.0, 2.0}},
      {"tanh(x)", [](Real x) { return std::tanh(x); }, {-1.0, 0.0, 2.0}},
      {"exp(-x)", [](Real x) { return std::exp(-x); }, {-1.0, 0.0, 2.0}},
      {"log(x)", [](Real x) { return std::log(x); }, {0.3, 2.0}},
      {"sqrt(x)", [](Real x) { return std::sqrt(x); }, {0.3, 2.0}},
      {"abs(x)*x", [](Real x) { return std::abs(x) * x; }, {-2.0, 0.7}},
      {"sign(x)*x^2", [](Real x) { return x > 0 ? x * x : -x * x; }, {-2.0, 0.7}},
      {"min(x, x^2)", [](Real x) { return std::min(x, x * x); }, {-2.0, 0.5, 3.0}},
      {"max(x, x^2)", [](Real x) { return std::max(x, x * x); }, {-2.0, 0.5, 3.0}},
      {"x^3", [](Real x) { return x * x * x; }, {-2.0, 0.0, 0.5}},
      {"x^7", [](Real x) { return std::pow(x, 7.0L); }, {-2.0, 0.0, 0.5}},
      {"x^-2", [](Real x) { return 1 / (x * x); }, {-2.0, 0.5}},
      {"x^2.5", [](Real x) { return std::pow(x, 2.5L); }, {0.5, 2.0}},
      {"2^x", [](Real x) { return std::pow(2.0L, x); }, {-2.0, 0.0, 0.5}},
      {"x^x", [](Real x) { return std::pow(x, x); }, {0.5, 2.0}},
      {"pow(x, sin(x))", [](Real x) { return std::pow(x, std::sin(x)); }, {0.5, 2.0}},
      {"(1 - x)/(2 + x)", [](Real x) { return (1 - x) / (2 + x); }, {-1.0, 0.0, 3.0}},
      {"5/x", [](Real x) { return 5 / x; }, {-1.0, 3.0}},
      {"x/3 - -x*x", [](Real x) { return x / 3 + x * x; }, {-1.0, 3.0}},
      {"(x*exp(x) - 1)/(x^2 + 1)",
       [](Real x) { return (x * std::exp(x) - 1) / (x * x + 1); },
       {-1.0, 0.0, 2.0}},
  };
  for (const DerivativeRow& row : rows) {
    Formulas formulas;
    const Node first = formulas.graph.differentiate(formulas.read(row.text), kX);
    const Node second = formulas.graph.differentiate(first, kX);
    for (const double x : row.points) {
      const Function derivative = [&](Real at) { return difference(row.function, at); };
      const auto d1 = static_cast<double>(derivative(x));
      const auto d2 = static_cast<double>(difference(derivative, x, 1.1e-3L));
      EXPECT_NEAR(formulas.evaluate(first, x), d1, 1e-12 * (1.0 + std::abs(d1)))
          << row.text << " at " << x;
      EXPECT_NEAR(formulas.evaluate(second, x), d2, 1e-9 * (1.0 + std::abs(d2)))
          << row.text << " at " << x;
    }
  }
}

TEST(ExpressionDerivatives, AtKinksAndEdges) {
  const auto derivative = [](const std::string& text, double x, double y = 0.0) {
    Formulas formulas;
    return formulas.evaluate(formulas.graph.differentiate(formulas.read(text), kX), x, y);
  };
  EXPECT_EQ(derivative("x^2", 0.0), 0.0);
  EXPECT_EQ(derivative("x^3", 0.0), 0.0);
  EXPECT_EQ(derivative("x^1", 0.0), 1.0);
  EXPECT_EQ(derivative("x^3", -2.0), 12.0);
  EXPECT_EQ(derivative("abs(x)", 0.0), 0.0);
  EXPECT_EQ(derivative("sign(x)", 0.0), 0.0);
  EXPECT_EQ(derivative("sqrt(x)", 0.0), kInfinity);
  // The exponent does not depend on x: no logarithm of a negative base.
  EXPECT_EQ(derivative("x^y", -2.0, 3.0), 12.0);
  EXPECT_EQ(derivative("x^(2 + y - y)", -2.0, 3.0), -4.0);
  // In a tie the first operand counts.
  EXPECT_EQ(derivative("min(x, 2*x)", 0.0), 1.0);
  EXPECT_EQ(derivative("min(2*x, x)", 0.0), 2.0);
  EXPECT_EQ(derivative("max(x, 2*x)", 0.0), 1.0);
  EXPECT_EQ(derivative("max(2*x, x)", 0.0), 2.0);
  EXPECT_TRUE(std::isnan(derivative("min(x, y)", 1.0, kNan)));
  EXPECT_TRUE(std::isnan(derivative("abs(x)", kNan)));
}

// If exp overflows, or only its derivative would, derivatives are those of the formula, even if
// that is constant to all digits.
TEST(ExpressionDerivatives, ExistWhereTheValueDoes) {
  struct Row {
    const char* text;  // of u = k (x - 1)
    Function first;    // by u
    Function second;
    double greatest = kInfinity;  // u at which the formula has a value
  };
  const auto sech = [](Real u) { return 1 / std::cosh(u); };
  const auto slope = [sech](Real u) { return sech(u / 2) * sech(u / 2) / 4; };  // of a logistic
  const auto bend = [slope](Real u) { return -std::tanh(u / 2) * slope(u); };
  // exp(-u), cut where all is over
  const auto decay = [](Real u) { return std::exp(-std::min(u, Real{11000})); };
  const auto logistic = [](Real u) { return 1 / (1 + std::exp(-u)); };
  const std::vector<Row> rows = {
      {"1/(1 + exp(u))", [=](Real u) { return -slope(u); }, [=](Real u) { return -bend(u); }},
      {"1/(1 + exp(-u))", slope, bend},
      {"1/(1 + 1/exp(u))", slope, bend},
      {"(exp(u) - 1)/(exp(u) + 1)", [=](Real u) { return 2 * slope(u); },
       [=](Real u) { return 2 * bend(u); }, 709.7},
      {"log(1 + exp(u))", logistic, slope, 709.7},
      {"1/(1 + 10^(u/log(10)))", [=](Real u) { return -slope(u); },
       [=](Real u) { return -bend(u); }},
      {"tanh(u)", [=](Real u) { return sech(u) * sech(u); },
       [=](Real u) { return -2 * std::tanh(u) * sech(u) * sech(u); }},
      {"1/cosh(u)", [=](Real u) { return -std::tanh(u) * sech(u); },
       [=](Real u) { return sech(u) * (1 - 2 * sech(u) * sech(u)); }},
      {"1/cosh(u)^2", [=](Real u) { return -2 * std::tanh(u) * sech(u) * sech(u); },
       [=](Real u) { return sech(u) * sech(u) * (4 - 6 * sech(u) * sech(u)); }},
      {"cosh(u)^-2", [=](Real u) { return -2 * std::tanh(u) * sech(u) * sech(u); },
       [=](Real u) { return sech(u) * sech(u) * (4 - 6 * sech(u) * sech(u)); }},
      {"sinh(u)/cosh(u)", [=](Real u) { return sech(u) * sech(u); },
       [=](Real u) { return -2 * std::tanh(u) * sech(u) * sech(u); }, 710.4},
      {"u/(1 + exp(u))", [=](Real u) { return logistic(-u) - u * slope(u); },
       [=](Real u) { return -2 * slope(u) - u * bend(u); }},
      {"1/(1 + exp(u))^2", [=](Real u) { return -2 * logistic(-u) * slope(u); },
       [=](Real u) { return 2 * slope(u) * slope(u) - 2 * logistic(-u) * bend(u); }},
      {"(1 + exp(u))^-2", [=](Real u) { return -2 * logistic(-u) * slope(u); },
       [=](Real u) { return 2 * slope(u) * slope(u) - 2 * logistic(-u) * bend(u); }},
      {"1/sqrt(1 + exp(u))", [=](Real u) { return -std::sqrt(logistic(-u)) * logistic(u) / 2; },
       [=](Real u) {
         return std::sqrt(logistic(-u)) * (logistic(u) * logistic(u) / 4 - slope(u) / 2);
       }},
      {"exp(-u^2)", [=](Real u) { return -2 * u * decay(u * u); },
       [=](Real u) { return (4 * u * u - 2) * decay(u * u); }},
      {"exp(-exp(u))", [=](Real u) { return u > 10 ? 0 : -std::exp(u) * std::exp(-std::exp(u)); },
       [=](Real u) {
         return u > 10 ? 0 : (std::exp(u) - 1) * std::exp(u) * std::exp(-std::exp(u));
       }},
      {"atan(exp(u))", [=](Real u) { return sech(u) / 2; },
       [=](Real u) { return -std::tanh(u) * sech(u) / 2; }},
      {"atan2(1, exp(u))", [=](Real u) { return -sech(u) / 2; },
       [=](Real u) { return std::tanh(u) * sech(u) / 2; }},
      {"tanh(exp(u) - 1)",
       [=](Real u) { return u > 10 ? 0 : std::exp(u) * std::pow(sech(std::exp(u) - 1), 2.0L); },
       [=](Real u) {
         const Real e = u > 10 ? 0 : std::exp(u);
         return std::pow(sech(e - 1), 2.0L) * (e - 2 * e * e * std::tanh(e - 1));
       }},
      {"1/(2 + exp(u) + 1/(1 + exp(u)))",
       [=](Real u) {
         return -(std::exp(u) - slope(u)) / std::pow(2 + std::exp(u) + logistic(-u), 2.0L);
       },
       nullptr, 5000.0},
  };
  constexpr double k = 1e6;
  for (const Row& row : rows) {
    Formulas formulas;
    formulas.symbols["u"] = formulas.read("1e6*(x - 1)");
    const Node f = formulas.read(row.text);
    const Node first = formulas.graph.differentiate(f, kX);
    const Node second = formulas.graph.differentiate(first, kX);
    const Node third = formulas.graph.differentiate(second, kX);
    for (const double size : {0.01,  1.0,    9.0,   30.0,  177.0, 178.0, 354.0, 355.0, 356.0,
                              400.0, 680.0,  690.0, 696.0, 700.0, 705.0, 709.0, 709.7, 709.79,
                              710.3, 710.48, 711.0, 745.2, 746.0, 1e3,   1e4,   1e6}) {
      for (const double sign : {-1.0, 1.0}) {
        const double x = 1.0 + sign * size / k;
        const double u = k * (x - 1.0);
        if (u > row.greatest || -u > row.greatest) continue;
        const std::string where = std::string(row.text) + " at u = " + std::to_string(u);
        const std::vector<double> values =
            formulas.evaluate({f, first, second, third}, {x, 0.0, 0.0, 0.0});
        ASSERT_TRUE(std::isfinite(values[0])) << where;
        const auto expected = static_cast<double>(row.first(u));
        EXPECT_NEAR(values[1], k * expected, k * (1e-12 * std::abs(expected) + 1e-15)) << where;
        if (row.second) {
          const auto curvature = static_cast<double>(row.second(u));
          EXPECT_NEAR(values[2], k * k * curvature, k * k * (1e-12 * std::abs(curvature) + 4e-15))
              << where;
        }
        EXPECT_TRUE(std::isfinite(values[3])) << where;
      }
    }
  }
}

// At a pole a function has a derivative that no limit tells: no value is better than a wrong one.
TEST(ExpressionDerivatives, AreNotGuessedAtPoles) {
  for (const char* text : {"1/(1/x)", "atan(1/x)", "1/(1/x + exp(y))", "1/(exp(y)/x)",
                           "1/(x^-1 + exp(y))", "atan(exp(y)*x^-3)", "tanh(log(x) + exp(y))"}) {
    Formulas formulas;
    const Node node = formulas.read(text);
    EXPECT_TRUE(std::isfinite(formulas.evaluate(node, 0.0, 2.0))) << text;
    EXPECT_FALSE(std::isfinite(formulas.evaluate(formulas.graph.differentiate(node, kX), 0.0, 2.0)))
        << text;
  }
  // Nor where the limit is still far off when a part overflows.
  for (const char* text : {"(1 + exp(x))^-0.001", "1/(1 + exp(x))^0.001", "1/log(2 + exp(x))",
                           "(1 + exp(x))^(0.001*y)"}) {
    Formulas formulas;
    const Node derivative = formulas.graph.differentiate(formulas.read(text), kX);
    EXPECT_FALSE(std::isfinite(formulas.evaluate(derivative, 800.0, -1.0))) << text;
    EXPECT_TRUE(std::isfinite(formulas.evaluate(derivative, 700.0, -1.0))) << text;
  }
}

TEST(ExpressionDerivatives, TotalDerivativeIsTheSumOfPartialsTimesRates) {
  Formulas formulas;
  Graph& graph = formulas.graph;
  const Node f = formulas.read("sin(x*y)*exp(z) + x^3/y - w");
  const Node rate = graph.totalDerivative(
      f, {{kX, graph.constant(1.0)}, {kY, graph.variable(kZ)}, {kZ, graph.variable(kW)}});
  const std::array<double, 4> point = {0.3, 1.2, -0.4, 0.9};
  const std::vector<double> values = formulas.evaluate(
      {rate, graph.differentiate(f, kX), graph.differentiate(f, kY), graph.differentiate(f, kZ)},
      point);
  EXPECT_NEAR(values[0], values[1] + values[2] * point[2] + values[3] * point[3], 1e-15);
}

TEST(ExpressionDerivatives, WhatDoesNotDependIsAConstantZero) {
  Formulas formulas;
  Graph& graph = formulas.graph;
  const Node f = formulas.read("sin(x) + x*y");
  EXPECT_TRUE(graph.dependsOn(f, kX));
  EXPECT_FALSE(graph.dependsOn(f, kZ));
  EXPECT_TRUE(graph.isConstant(graph.differentiate(f, kZ), 0.0));
  EXPECT_TRUE(graph.isConstant(graph.differentiate(graph.differentiate(f, kY), kY), 0.0));
  EXPECT_EQ(graph.differentiate(f, kY), formulas.read("x"));
  // A zero that the user wrote does not hide a NaN ...
  EXPECT_TRUE(std::isnan(valueOf("0*log(x)", -1.0)));
  EXPECT_TRUE(std::isnan(valueOf("x - x", kInfinity)));
  // ... but it has no derivative.
  EXPECT_TRUE(graph.isConstant(graph.differentiate(formulas.read("0*log(x)"), kX), 0.0));
}

// ------------------------------------------------------------------------------------- random
// trees

/// Value and derivatives by x, y, z: forward mode, to compare with.
template <typename T>
struct Dual {
  T v = 0;
  std::array<T, 3> d = {};
};

/// Whether an exact zero was met: its sign is not kept, and 1/0 or atan2 may show it.
bool saw_zero = false;

template <typename T>
Dual<T> chain(const Dual<T>& a, T value, T slope) {
  Dual<T> result{value, {}};
  saw_zero = saw_zero || value == 0;
  for (std::size_t i = 0; i < 3; ++i) result.d[i] = slope * a.d[i];
  return result;
}
template <typename T>
Dual<T> combine(const Dual<T>& a, const Dual<T>& b, T value, T by_a, T by_b) {
  Dual<T> result{value, {}};
  saw_zero = saw_zero || value == 0;
  for (std::size_t i = 0; i < 3; ++i) result.d[i] = by_a * a.d[i] + by_b * b.d[i];
  return result;
}

/// A formula, evaluated as simply as can be.
struct Tree {
  std::string what;
  std::vector<Tree> children;

  std::string toText() const {
    if (children.empty()) return what;
    if (children.size() == 2 && what.size() == 1) {
      return "(" + children[0].toText() + what + children[1].toText() + ")";
    }
    if (what == "neg") return "(-" + children[0].toText() + ")";
    if (what[0] == '^') return "(" + children[0].toText() + what + ")";
    return what + "(" + children[0].toText() +
           (children.size() == 2 ? "," + children[1].toText() : "") + ")";
  }

  template <typename T>
  Dual<T> evaluate(const std::array<double, 3>& point) const {
    if (children.empty()) {
      if (what == "x") return {point[0], {1, 0, 0}};
      if (what == "y") return {point[1], {0, 1, 0}};
      if (what == "z") return {point[2], {0, 0, 1}};
      return {static_cast<T>(std::strtod(what.c_str(), nullptr)), {}};
    }
    const Dual<T> a = children[0].evaluate<T>(point);
    if (children.size() == 2) {
      const Dual<T> b = children[1].evaluate<T>(point);
      if (what == "+") return combine<T>(a, b, a.v + b.v, 1, 1);
      if (what == "-") return combine<T>(a, b, a.v - b.v, 1, -1);
      if (what == "*") return combine<T>(a, b, a.v * b.v, b.v, a.v);
      if (what == "/") return combine<T>(a, b, a.v / b.v, 1 / b.v, -a.v / (b.v * b.v));
      if (std::isnan(a.v + b.v)) return {a.v + b.v, {}};
      if (what == "min") return a.v <= b.v ? a : b;
      if (what == "max") return a.v >= b.v ? a : b;
      const T square = a.v * a.v + b.v * b.v;
      return combine<T>(a, b, std::atan2(a.v, b.v), b.v / square, -a.v / square);
    }
    if (what == "neg") return chain<T>(a, -a.v, -1);
    if (what == "^2") return chain<T>(a, a.v * a.v, 2 * a.v);
    if (what == "^3") return chain<T>(a, a.v * a.v * a.v, 3 * a.v * a.v);
    if (what == "^(-1)") return chain<T>(a, 1 / a.v, -1 / (a.v * a.v));
    if (what == "sin") return chain<T>(a, std::sin(a.v), std::cos(a.v));
    if (what == "cos") return chain<T>(a, std::cos(a.v), -std::sin(a.v));
    if (what == "tanh") return chain<T>(a, std::tanh(a.v), 1 - std::tanh(a.v) * std::tanh(a.v));
    if (what == "exp") return chain<T>(a, std::exp(a.v), std::exp(a.v));
    if (what == "atan") return chain<T>(a, std::atan(a.v), 1 / (1 + a.v * a.v));
    if (what == "sqrt") return chain<T>(a, std::sqrt(a.v), 1 / (2 * std::sqrt(a.v)));
    return chain<T>(a, std::abs(a.v), a.v > 0 ? T(1) : T(-1));
  }
};

Tree makeTree(std::mt19937& generator, int depth) {
  const auto pick = [&generator](const std::vector<std::string>& names) {
    return names[std::uniform_int_distribution<std::size_t>(0, names.size() - 1)(generator)];
  };
  const int kind = depth == 0 ? 0 : std::uniform_int_distribution<int>(0, 9)(generator);
  if (kind == 0) {
    return {pick({"x", "y", "z", "x", "y", "z", "0.3", "1.7", "4", "1", "0.5"}), {}};
  }
  if (kind <= 6) {
    return {pick({"+", "-", "*", "/", "+", "-", "*", "+", "-", "*", "min", "max", "atan2"}),
            {makeTree(generator, depth - 1), makeTree(generator, depth - 1)}};
  }
  return {
      pick({"neg", "neg", "^2", "^3", "^(-1)", "sin", "cos", "tanh", "exp", "atan", "sqrt", "abs"}),
      {makeTree(generator, depth - 1)}};
}

TEST(ExpressionRandom, TreesAgreeWithAPlainEvaluatorAndDualNumbers) {
  std::mt19937 generator(20240607);
  std::uniform_real_distribution<double> coordinate(-2.0, 2.0);
  int compared_values = 0;
  int compared_derivatives = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    const Tree tree = makeTree(generator, 2 + trial % 5);
    const std::string text = tree.toText();
    const std::array<double, 3> point = {coordinate(generator), coordinate(generator),
                                         coordinate(generator)};
    Formulas formulas;
    Node node;
    try {
      node = formulas.read(text);
    } catch (const ExpressionError&) {
      continue;  // a constant part such as 1/(0.3 - 0.3)
    }
    Graph& graph = formulas.graph;
    const std::vector<double> actual =
        formulas.evaluate({node, graph.differentiate(node, kX), graph.differentiate(node, kY),
                           graph.differentiate(node, kZ)},
                          {point[0], point[1], point[2], 0.0});
    saw_zero = false;
    const Dual<double> plain = tree.evaluate<double>(point);
    if (!std::isfinite(plain.v) || saw_zero) {
      continue;
    }
    ASSERT_EQ(actual[0], plain.v) << text;
    ++compared_values;
    // How far double and long double are apart says how well conditioned a derivative is.
    const Dual<Real> exact = tree.evaluate<Real>(point);
    for (std::size_t i = 0; i < 3; ++i) {
      const double conditioning = std::abs(static_cast<double>(exact.d[i]) - plain.d[i]);
      const double size = std::abs(plain.d[i]);
      if (std::isfinite(conditioning) && conditioning <= 1e-9 * (1.0 + size)) {
        ASSERT_NEAR(actual[i + 1], static_cast<double>(exact.d[i]),
                    1e-11 * (1.0 + size) + 1e3 * conditioning)
            << text << " by variable " << i;
        ++compared_derivatives;
      }
    }
  }
  EXPECT_GT(compared_values, 3000);
  EXPECT_GT(compared_derivatives, 9000);
}

// ------------------------------------------------------------------------------------------- graph

TEST(ExpressionGraph, EqualSubexpressionsAreOneNode) {
  Formulas formulas;
  EXPECT_EQ(formulas.read("sin(x + y)"), formulas.read("sin(y+x)"));
  EXPECT_EQ(formulas.read("x*2"), formulas.read("2*x"));
  EXPECT_EQ(formulas.read("x + x"), formulas.read("2*x"));
  EXPECT_EQ(formulas.read("x^2"), formulas.read("x*x"));
  EXPECT_EQ(formulas.read("pow(x, 2)"), formulas.read("x*x"));
  EXPECT_EQ(formulas.read("--x"), formulas.read("x"));
  EXPECT_EQ(formulas.read("x*1 + 0"), formulas.read("x"));
  EXPECT_EQ(formulas.read("x - -y"), formulas.read("x + y"));
  EXPECT_EQ(formulas.read("-(x - y)"), formulas.read("y - x"));
  EXPECT_EQ(formulas.read("x/4"), formulas.read("0.25*x"));
  EXPECT_NE(formulas.read("x/3"), formulas.read("x*(1/3)"));
  EXPECT_NE(formulas.read("min(x, y)"), formulas.read("min(y, x)"));
  EXPECT_TRUE(formulas.graph.isConstant(formulas.read("2*3 + sin(0.5)"), 6.0 + std::sin(0.5)));
}

TEST(ExpressionTape, HasOneValueForEachOutput) {
  Formulas formulas;
  formulas.read("exp(z)*tan(w)");
  EXPECT_EQ(Tape().outputCount(), 0);
  // The second one is the first, and the third a constant.
  const std::vector<Node> outputs = {formulas.read("x*y + 2"), formulas.read("2 + y*x"),
                                     formulas.read("3")};
  EXPECT_EQ(Tape(formulas.graph, outputs).outputCount(), 3);
  EXPECT_EQ(formulas.evaluate(outputs, {2.0, 5.0, 0.0, 0.0}), (std::vector<double>{12, 12, 3}));
}

TEST(ExpressionTape, ReadsEverySourceAndOnlyWhatItNeeds) {
  Graph graph;
  const double angle[] = {1.0, 2.0};
  const double velocity[] = {3.0, 4.0};
  const double acceleration[] = {5.0, 6.0};
  const double input[] = {7.0, 8.0};
  const double input_rate[] = {9.0, 10.0};
  const double input_second_rate[] = {11.0, 12.0};
  const StateView state = {0.5,   angle,      velocity,         acceleration,
                           input, input_rate, input_second_rate};
  std::vector<Node> nodes = {graph.variable(slotOf(Source::kTime))};
  for (const Source source : {Source::kAngle, Source::kVelocity, Source::kAcceleration,
                              Source::kInput, Source::kInputRate, Source::kInputSecondRate}) {
    nodes.push_back(graph.variable(slotOf(source, 0)));
    nodes.push_back(graph.variable(slotOf(source, 1)));
  }
  std::vector<double> values(nodes.size());
  Tape(graph, nodes).evaluate(state, values.data());
  EXPECT_EQ(values, (std::vector<double>{0.5, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));

  const StateView only_time = {0.5, nullptr, nullptr, nullptr, nullptr, nullptr};
  double value = 0.0;
  Tape(graph, {graph.multiply(nodes[0], nodes[0])}).evaluate(only_time, &value);
  EXPECT_EQ(value, 0.25);

  EXPECT_THROW(Tape(graph, {graph.variable(slotOf(Source::kJerk))}), std::invalid_argument);
}

TEST(ExpressionTape, MayWriteItsOutputsOverItsInputs) {
  Formulas formulas;
  const Tape tape(formulas.graph, {formulas.read("x + y"), formulas.read("x*y")});
  double angle[] = {3.0, 5.0};
  tape.evaluate({0.0, angle, nullptr, nullptr, nullptr, nullptr}, angle);
  EXPECT_EQ(angle[0], 8.0);
  EXPECT_EQ(angle[1], 15.0);
}

TEST(ExpressionTape, RepeatsAndCopiesItself) {
  Formulas formulas;
  const Tape tape(formulas.graph, {formulas.read("sin(x)*cos(x) + x^5/3 - min(x, 2)")});
  const Tape copy = tape;
  for (const double x : {0.3, 4.0, 0.3}) {
    double values[2] = {};
    const StateView state = {0.0, &x, nullptr, nullptr, nullptr, nullptr};
    tape.evaluate(state, &values[0]);
    copy.evaluate(state, &values[1]);
    EXPECT_EQ(values[0], values[1]);
    EXPECT_NEAR(values[0], std::sin(x) * std::cos(x) + std::pow(x, 5) / 3 - std::min(x, 2.0),
                1e-13 * (1.0 + std::abs(values[0])));
  }
}

/// "curve" of one variable, "map" of two.
NamedTables someTables() {
  const auto numbers = [](const std::vector<double>& values) {
    ParameterTree::List list;
    for (const double value : values) list.push_back(ParameterTree::real(value));
    return ParameterTree::list(std::move(list));
  };
  const ParameterTree tree = ParameterTree::dictionary(
      {{"x", numbers({0.0, 0.4, 1.0})},
       {"y", numbers({0.0, 1.0})},
       {"z",
        ParameterTree::list({numbers({1.0, 2.0}), numbers({3.0, 5.0}), numbers({4.0, 4.0})})}});
  ParameterReader reader(tree, "");
  const Table::Beyond beyond = Table::Beyond::kLinear;
  NamedTables tables;
  tables["curve"] = std::make_shared<Table>(
      Table::read(reader, {{"x", Range::any()}, {"x", Range::any()}}, beyond));
  tables["map"] = std::make_shared<Table>(Table::read(reader, {{"x"}, {"y"}, {"z"}}, beyond));
  return tables;
}

TEST(ExpressionTape, AllocatesNothingWhileItEvaluates) {
  Formulas formulas;
  std::string text = "0";
  for (const std::string& name : functionNames()) {
    const bool two = name == "atan2" || name == "min" || name == "max" || name == "pow";
    text += "+" + name +
            (name == "if"      ? "(x < y, x, y)"
             : name == "clamp" ? "(x, y, 2)"
             : two             ? "(x, y)"
                               : "(x*y)");
  }
  text += "+curve(x*y)+map(x, y)";
  const Node node = parse(text, formulas.symbols, formulas.graph, {}, someTables());
  const Tape tape(formulas.graph, {node, formulas.graph.differentiate(node, kX)});
  double angle[] = {0.3, 0.9};
  double values[2] = {};
  const long before = allocations;
  for (int i = 0; i < 1000; ++i) {
    angle[0] += 1e-4;
    tape.evaluate({0.0, angle, nullptr, nullptr, nullptr, nullptr}, values);
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GT(before, 0) << "the counter does not count";
  EXPECT_TRUE(std::isfinite(values[0]) && std::isfinite(values[1]));
}

// ------------------------------------------------------------------------------------------ errors

void expectError(const std::string& text, const std::string& column, const std::string& message) {
  const ExpressionError error = errorOf(text);
  const std::string what = error.what();
  EXPECT_EQ(std::to_string(error.column()), column) << what;
  EXPECT_EQ(what.rfind(message, 0), 0U) << text << ": " << what;
  EXPECT_NE(what.find(" at column " + column), std::string::npos) << what;
}

TEST(ExpressionErrors, NameThePlaceAndWhatIsExpected) {
  expectError("", "1", "the formula is empty");
  expectError("  \t ", "1", "the formula is empty");
  expectError("x * / y", "5", "expected a number, a name or '(' instead of '/'");
  const auto sections = test::readFaultSections("formulas");
  ASSERT_EQ(sections.size(), 1U);
  for (const test::Fault& fault : test::readFaults("", sections[0].second)) {
    expectError(fault.text, fault.path, fault.words.at(0));
  }
}

TEST(ExpressionErrors, ShowThePlaceWithACaret) {
  EXPECT_STREQ(errorOf("x +\n* y").what(),
               "expected a number, a name or '(' instead of '*' at column 5\n"
               "  x + * y\n"
               "      ^");
  // A long formula is cut around the place.
  const std::string what = errorOf(std::string(300, '(') + "?").what();
  for (std::size_t begin = 0; begin < what.size();) {
    const std::size_t end = std::min(what.find('\n', begin), what.size());
    EXPECT_LT(end - begin, 100U);
    begin = end + 1;
  }
}

TEST(ExpressionErrors, AreExplainedByWhoKnowsTheScene) {
  Formulas formulas;
  const std::string fault = test::messageOf([&] {
    parse("x*w3", formulas.symbols, formulas.graph,
          [](const std::string& name) { return name == "w3" ? "only two" : ""; });
  });
  EXPECT_EQ(fault.rfind("unknown name 'w3': only two at column 3", 0), 0U) << fault;
}

std::string repeat(const std::string& piece, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += piece;
  return text;
}

TEST(ExpressionErrors, LongAndDeepTextsEndInAnAnswer) {
  constexpr int kMany = 100000;
  EXPECT_EQ(valueOf(repeat("(", kMaxNesting) + "x" + repeat(")", kMaxNesting), 3.0), 3.0);
  EXPECT_EQ(valueOf(repeat("abs(", kMaxNesting) + "x" + repeat(")", kMaxNesting), 3.0), 3.0);
  for (const std::string piece : {"(", "sin(", "-(", "2^(", "max(1,"}) {
    const ExpressionError error = errorOf(repeat(piece, kMany));
    EXPECT_EQ(std::string(error.what()).rfind("nested deeper than 200 levels", 0), 0U)
        << error.what();
    EXPECT_EQ(static_cast<std::size_t>(error.column()),
              kMaxNesting * piece.size() + piece.find('(') + 1);
  }
  // Parentheses and calls are counted together.
  const std::string both = "(-max(1,2^";
  EXPECT_EQ(static_cast<std::size_t>(errorOf(repeat(both, kMany)).column()),
            kMaxNesting / 2 * both.size() + 1);
  EXPECT_EQ(valueOf(repeat("-", kMany) + "x", 3.0), 3.0);
  EXPECT_EQ(valueOf(repeat("-", kMany + 1) + "x", 3.0), -3.0);
  EXPECT_EQ(valueOf("x" + repeat("^x", kMany), 1.0), 1.0);
  EXPECT_EQ(valueOf("0." + repeat("3", kMany)), 1.0 / 3.0);
  EXPECT_EQ(errorOf(repeat("3", kMany)).column(), 1);
  EXPECT_EQ(errorOf(repeat("q", kMany)).column(), 1);
  EXPECT_EQ(valueOf(repeat("(x)+", kMany) + "x", 1.0), kMany + 1.0);

  Formulas formulas;
  const Node sum = formulas.read("x" + repeat("+y*x+x", kMany));
  const Node derivative = formulas.graph.differentiate(sum, kX);
  EXPECT_EQ(formulas.evaluate(sum, 1.0, 2.0), 1.0 + 3.0 * kMany);
  EXPECT_EQ(formulas.evaluate(derivative, 1.0, 2.0), 1.0 + 3.0 * kMany);

  // More constants than 16 bits can count.
  std::string large = "0";
  for (int i = 1; i < 70000; ++i) large += "+x/" + std::to_string(i) + "*" + std::to_string(i);
  EXPECT_NEAR(formulas.evaluate(formulas.read(large), 2.0, 0.0), 2.0 * 69999, 1e-6);
}

TEST(ExpressionNames, AreLettersDigitsAndUnderscores) {
  EXPECT_TRUE(isValidName("tau_2"));
  EXPECT_TRUE(isValidName("_"));
  EXPECT_FALSE(isValidName(""));
  EXPECT_FALSE(isValidName("2tau"));
  EXPECT_FALSE(isValidName("a-b"));
  EXPECT_EQ(functionNames().size(), 20U);
  EXPECT_EQ(valueOf("atan2(x,y)", 1.0, 2.0), std::atan2(1.0, 2.0));
}

}  // namespace
}  // namespace variator_sim::expression
