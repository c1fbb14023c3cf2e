// Formulas beyond arithmetic: comparisons, limits and tables.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "support/faults.h"
#include "variator_sim/expression/guards.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim::expression {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::shared_ptr<const Table> table(const std::string& yaml,
                                   Table::Beyond beyond = Table::Beyond::kConstant) {
  const ParameterTree tree = readYamlText(yaml, "table");
  ParameterReader reader(tree, "table");
  return std::make_shared<const Table>(reader.has("y")
                                           ? Table::read(reader, {{"x"}, {"y"}, {"values"}}, beyond)
                                           : Table::read(reader, {{"x"}, {"values"}}, beyond));
}

const char* const kCurve = "{x: [-1, 0.5, 2, 2.5, 4], values: [1, 3, -2, 0, 0.5]}";
const char* const kMap =
    "{x: [-1, 0.5, 2, 4], y: [-2, 0, 0.7], values: [[1, 3, 0], [-2, 0, 5], [2, 2, 1], [0, 1, 4]]}";

/// t, and a velocity and an acceleration of each of two shafts.
struct Formulas {
  Formulas() {
    symbols["t"] = graph.variable(slotOf(Source::kTime));
    symbols["x"] = graph.variable(slotOf(Source::kVelocity, 0));
    symbols["y"] = graph.variable(slotOf(Source::kVelocity, 1));
    symbols["j"] = graph.variable(slotOf(Source::kJerk, 0));
  }
  Node read(const std::string& text) { return parse(text, symbols, graph, {}, tables); }
  double evaluate(Node node, double x, double y = 0.0, double t = 0.0) const {
    const double velocity[] = {x, y};
    double value = 0.0;
    Tape(graph, {node}).evaluate({t, nullptr, velocity, nullptr, nullptr, nullptr}, &value);
    return value;
  }
  double evaluate(const std::string& text, double x, double y = 0.0) {
    return evaluate(read(text), x, y);
  }
  std::string messageOf(const std::string& text) {
    return test::messageOf([&] { read(text); });
  }

  Graph graph;
  SymbolTable symbols;
  NamedTables tables;
};

// ------------------------------------------------------------------------------------ comparisons

TEST(Choice, TakesTheBranchOfItsComparison) {
  Formulas f;
  for (const double x : {-1.0, 2.0, 3.0}) {
    EXPECT_EQ(f.evaluate("if(x < y, 10, 20)", x, 2.0), x < 2.0 ? 10.0 : 20.0) << x;
    EXPECT_EQ(f.evaluate("if(x <= y, 10, 20)", x, 2.0), x <= 2.0 ? 10.0 : 20.0) << x;
    EXPECT_EQ(f.evaluate("if(x > y, 10, 20)", x, 2.0), x > 2.0 ? 10.0 : 20.0) << x;
    EXPECT_EQ(f.evaluate("if( x>=y ,10,20)", x, 2.0), x >= 2.0 ? 10.0 : 20.0) << x;
    EXPECT_EQ(f.evaluate("if(x + 1 < 2*y - 1, x^2, if(y > 0, -x, 0))", x, 2.0),
              x < 2.0 ? x * x : -x)
        << x;
  }
  EXPECT_TRUE(std::isnan(f.evaluate("if(x < y, 10, 20)", kNan, 2.0)));
  EXPECT_TRUE(std::isnan(f.evaluate("if(x >= y, 10, 20)", 1.0, kNan)));
  // The other branch has no effect.
  EXPECT_EQ(f.evaluate("if(x < 1, 3, sqrt(x - 1))", 0.0), 3.0);
  EXPECT_EQ(f.evaluate("if(2 < 3, x, y)", 5.0, 6.0), 5.0);
}

TEST(Choice, IsDifferentiatedByBranch) {
  Formulas f;
  const Node slope =
      f.graph.differentiate(f.read("if(x < y, x^2, 5*x)"), slotOf(Source::kVelocity, 0));
  EXPECT_EQ(f.evaluate(slope, 1.5, 2.0), 3.0);
  EXPECT_EQ(f.evaluate(slope, 2.5, 2.0), 5.0);
}

TEST(Choice, JumpsAtItsEdge) {
  Formulas f;
  const std::vector<Branch> branches = findBranches(f.graph, {f.read("if(x < 2*y, 1, 0)")});
  ASSERT_EQ(branches.size(), 1U);
  EXPECT_TRUE(branches[0].jumps);
  EXPECT_LT(f.evaluate(branches[0].argument, 1.0, 1.0) * f.evaluate(branches[0].argument, 3.0, 1.0),
            0.0);
  for (const Branch& it : findBranches(f.graph, {f.read("clamp(x, -1, y)")})) {
    EXPECT_FALSE(it.jumps);
  }
}

TEST(Choice, LimitsAValue) {
  Formulas f;
  EXPECT_EQ(f.evaluate("clamp(x, -1, y)", -3.0, 2.0), -1.0);
  EXPECT_EQ(f.evaluate("clamp(x, -1, y)", 0.5, 2.0), 0.5);
  EXPECT_EQ(f.evaluate("clamp(x, -1, y)", 7.0, 2.0), 2.0);
}

TEST(Choice, SaysWhatIsWrong) {
  Formulas f;
  const auto expectMessage = [&f](const std::string& text, const std::string& part) {
    EXPECT_NE(f.messageOf(text).find(part), std::string::npos) << text << ": " << f.messageOf(text);
  };
  expectMessage("if(x, 1, 2)", "expected '<', '<=', '>' or '>=' instead of ','");
  expectMessage("if(x == y, 1, 2)", "expected '<', '<=', '>' or '>=' instead of '='");
  expectMessage("if(x < y, 1)", "'if' takes 3 arguments");
  expectMessage("if(x < y, 1, 2, 3)", "'if' takes 3 arguments");
  expectMessage("if(x < y", "instead of the end");
  expectMessage("if()", "expected a number, a name or '('");
  expectMessage("if + 1", "the function 'if' needs its arguments in parentheses");
  expectMessage("x < y", "in the first argument of 'if' only");
  expectMessage("if(x < y < 2, 1, 2)", "in the first argument of 'if' only");
  expectMessage("if(x < y, x > 1, 2)", "in the first argument of 'if' only");
  expectMessage("max(x < y, 2)", "in the first argument of 'if' only");
  expectMessage("clamp(x, 1)", "the function 'clamp' takes 3 arguments, not 2");
  expectMessage("clamp(x, 2, 1)", "the limits of this 'clamp' are 2 and 1");
}

// ----------------------------------------------------------------------------------------- tables

TEST(TableNode, IsTheTable) {
  Formulas f;
  f.tables["curve"] = table(kCurve);
  f.tables["line"] = table(kCurve, Table::Beyond::kLinear);
  f.tables["map"] = table(kMap);
  for (double x = -3.0; x < 6.0; x += 0.137) {
    EXPECT_EQ(f.evaluate("2*curve(x)", x), 2.0 * f.tables["curve"]->value(x)) << x;
    EXPECT_EQ(f.evaluate("line(x)", x), f.tables["line"]->value(x)) << x;
    EXPECT_EQ(f.evaluate("curve(3*x)*line(x)", x),
              f.tables["curve"]->value(3.0 * x) * f.tables["line"]->value(x));
    EXPECT_EQ(f.evaluate("map(x, y - 1)", x, 0.3), f.tables["map"]->value(x, 0.3 - 1.0));
  }
  EXPECT_EQ(f.evaluate("curve(0.5)", 0.0), 3.0);
  EXPECT_TRUE(std::isnan(f.evaluate("curve(x)", kNan)));
  EXPECT_TRUE(std::isnan(f.evaluate("map(x, y)", 1.0, kNan)));
}

/// Central differences of a node against its derivative by the first velocity.
void expectDerivative(Formulas& f, Node node, double x, double y) {
  const Node slope = f.graph.differentiate(node, slotOf(Source::kVelocity, 0));
  const double h = 1e-5;
  const double difference = (f.evaluate(node, x + h, y) - f.evaluate(node, x - h, y)) / (2.0 * h);
  const double size = 1.0 + std::abs(difference);
  EXPECT_NEAR(f.evaluate(slope, x, y), difference, 1e-6 * size) << x << ", " << y;
}

TEST(TableNode, HasExactDerivatives) {
  for (const Table::Beyond beyond : {Table::Beyond::kConstant, Table::Beyond::kLinear}) {
    Formulas f;
    f.tables["curve"] = table(kCurve, beyond);
    f.tables["map"] = table(kMap, beyond);
    for (const char* text : {"curve(x*y)", "map(x, y)", "map(sin(y), x)", "map(x, x*y)*curve(x)"}) {
      Node node = f.read(text);
      for (int order = 0; order < 3; ++order) {
        for (double x = -2.06; x < 5.0; x += 0.31) expectDerivative(f, node, x, 0.43);
        node = f.graph.differentiate(node, slotOf(Source::kVelocity, 0));
      }
    }
  }
}

TEST(TableNode, EndsAtTheDegreeOfItsPolynomials) {
  Formulas f;
  f.tables["curve"] = table(kCurve);
  Node node = f.read("curve(x)");
  for (int order = 0; order < 5; ++order) {
    node = f.graph.differentiate(node, slotOf(Source::kVelocity, 0));
    EXPECT_FALSE(f.graph.isConstant(node)) << order;
  }
  EXPECT_TRUE(f.graph.isConstant(f.graph.differentiate(node, slotOf(Source::kVelocity, 0)), 0.0));
}

TEST(SwitchingFunctions, AreOneForEachArgument) {
  Formulas f;
  const auto branchesOf = [&](const char* text) { return findBranches(f.graph, {f.read(text)}); };
  EXPECT_EQ(branchesOf("abs(x)+abs(x)+sign(x)").size(), 1U);
  EXPECT_TRUE(branchesOf("abs(x)+sign(x)")[0].jumps);
  EXPECT_FALSE(branchesOf("max(x,y)")[0].jumps);
  EXPECT_EQ(branchesOf("max(x,min(y,3))").size(), 2U);
  EXPECT_TRUE(branchesOf("sin(x)*y").empty());
  EXPECT_TRUE(branchesOf("abs(-3)*y").empty());
}

TEST(TableNode, HasSwitchingFunctionsOfItsArguments) {
  Formulas f;
  f.tables["curve"] = table(kCurve);
  f.tables["map"] = table(kMap);
  const auto countIn = [&](const char* text) {
    return countSwitchingFunctions(f.graph, {f.read(text)});
  };
  EXPECT_EQ(countIn("curve(x) + 3*curve(x)"), 1U);
  EXPECT_EQ(countIn("map(x, y) + abs(x)"), 3U);
  EXPECT_EQ(countIn("curve(t)*x"), 0U);
  EXPECT_EQ(countIn("map(t, x)"), 1U);
  const std::vector<Passage> passages = findPassages(f.graph, {f.read("curve(2*x)")});
  ASSERT_EQ(passages.size(), 1U);
  EXPECT_EQ(passages[0].points.size(), 5U);
  EXPECT_EQ(f.evaluate(passages[0].argument, 0.25, 0.0), 0.5);
}

TEST(TableNode, NeedsItsArguments) {
  Formulas f;
  f.tables["curve"] = table(kCurve);
  f.tables["map"] = table(kMap);
  EXPECT_NE(f.messageOf("curve").find("the table 'curve' needs its arguments"), std::string::npos);
  EXPECT_NE(f.messageOf("map(x)").find("the table 'map' takes 2 arguments, not 1"),
            std::string::npos);
  EXPECT_NE(f.messageOf("curv(x)").find("did you mean 'curve'?"), std::string::npos);
}

// ------------------------------------------------------------------------------ tables of two

TEST(TableOfTwo, GoesThroughItsPoints) {
  for (const Table::Beyond beyond : {Table::Beyond::kConstant, Table::Beyond::kLinear}) {
    const auto map = table(kMap, beyond);
    const double z[4][3] = {{1, 3, 0}, {-2, 0, 5}, {2, 2, 1}, {0, 1, 4}};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        EXPECT_EQ(map->value(map->points(0)[i], map->points(1)[j]), z[i][j]);
      }
    }
  }
}

TEST(TableOfTwo, IsTwiceContinuouslyDifferentiable) {
  for (const Table::Beyond beyond : {Table::Beyond::kConstant, Table::Beyond::kLinear}) {
    const auto map = table(kMap, beyond);
    const double h = 1e-9;
    for (const Table::Order order : {Table::Order{0, 0}, {1, 0}, {0, 1}, {1, 1}, {2, 0}, {0, 2}}) {
      for (const double x : map->points(0)) {
        for (double y = -3.1; y < 2.0; y += 0.37) {
          EXPECT_NEAR(map->derivative(order, x - h, y), map->derivative(order, x + h, y), 2e-6);
        }
      }
      for (const double y : map->points(1)) {
        for (double x = -2.1; x < 5.0; x += 0.37) {
          EXPECT_NEAR(map->derivative(order, x, y - h), map->derivative(order, x, y + h), 2e-6);
        }
      }
    }
  }
}

TEST(TableOfTwo, MeetsBilinearDataExactly) {
  // z = 2 + 3 x - y + x y / 2
  const auto map = table(
      "{x: [0, 1, 4, 6], y: [-2, 0, 6], values: [[4, 2, -4], [6, 5, 2], [12, 14, 20], [16, 20, "
      "32]]}",
      Table::Beyond::kLinear);
  for (double x = -3.0; x < 9.0; x += 0.21) {
    for (double y = -5.0; y < 9.0; y += 0.33) {
      EXPECT_NEAR(map->value(x, y), 2.0 + 3.0 * x - y + 0.5 * x * y, 1e-12);
    }
  }
}

TEST(TableOfTwo, StaysAtItsEdges) {
  const auto map = table(kMap);
  for (const double far : {1.0, 1e9, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(map->value(4.0 + far, 0.3), map->value(4.0, 0.3));
    EXPECT_EQ(map->value(1.0, -2.0 - far), map->value(1.0, -2.0));
    EXPECT_EQ(map->derivative({1, 0}, 4.0 + far, 0.3), 0.0);
  }
}

TEST(TableOfTwo, SaysWhatIsWrong) {
  const auto messageOf = [](const std::string& yaml) -> std::string {
    return test::messageOf([&] { table(yaml); });
  };
  EXPECT_NE(messageOf("{x: [0, 1], y: [0, 1, 2], values: [[1, 2, 3]]}").find("1 rows; expected"),
            std::string::npos);
  EXPECT_NE(messageOf("{x: [0, 1], y: [0, 1, 2], values: [[1, 2, 3], [1, 2]]}")
                .find("table/values[1]: [1, 2]; expected a list of 2 rows"),
            std::string::npos);
  EXPECT_NE(messageOf("{x: [0, 1], y: [0, 2, 2], values: [[1, 2, 3], [1, 2, 3]]}")
                .find("table/y[2]: 2.0 does not lie above 2.0"),
            std::string::npos);
  EXPECT_NE(
      messageOf("{x: [0, 1], y: [0, 1], values: [[1, 2], [1, a]]}").find("table/values[1][1]"),
      std::string::npos);
}

}  // namespace
}  // namespace variator_sim::expression
