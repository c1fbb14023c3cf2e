// Formulas along a motion as power series: the sum of the series against the value of the same
// formula where the motion then is, as the tape computes it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "expression/series_program.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {
namespace {

using Part = SeriesProgram::Part;
using Numbers = std::vector<double>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kOrder = 31;

/// The variables of a formula at s: t = t_0 + t_1 s, the others any polynomial.
struct Path {
  Numbers t = {0.3, 1.0};
  Numbers x = {0.7, 0.5, -0.2, 0.1};
  Numbers y = {1.3, -0.4, 0.3};
  Numbers e = {-0.6, 0.8, 0.25, -0.1};  ///< an acceleration
};

NamedTables makeTables() {
  const auto numbers = [](const Numbers& values) {
    ParameterTree::List list;
    for (const double value : values) list.push_back(ParameterTree::real(value));
    return ParameterTree::list(std::move(list));
  };
  const ParameterTree tree = ParameterTree::dictionary(
      {{"x", numbers({0.0, 0.4, 1.0, 1.7})},
       {"y", numbers({-1.0, 0.5, 2.0})},
       {"z", ParameterTree::list({numbers({1.0, 2.0, 1.0}), numbers({3.0, 5.0, 4.5}),
                                  numbers({4.0, 4.0, -1.0}), numbers({2.0, 0.5, 0.0})})}});
  ParameterReader reader(tree, "");
  const Numbers x = {0.0, 0.4, 1.0, 1.7};
  const Numbers y = {1.0, 2.5, 3.0, -1.0};
  NamedTables tables;
  const auto add = [&](const std::string& name, Table::Beyond beyond) {
    tables[name].of_one = std::make_shared<Table>(Table::through(x, y, beyond));
    tables[name + "_map"].of_two =
        std::make_shared<Table2>(Table2::read(reader, {"x", "y", "z"}, beyond));
  };
  add("level", Table::Beyond::kConstant);
  add("straight", Table::Beyond::kLinear);
  return tables;
}

/// An acceleration that is known.
class Solved final : public expression::AccelerationSolver {
 public:
  Solved(SeriesProgram& program, double value) : program_(program), value_(value) {}
  void solve(int n) override { program_.set(program_.variable(3), n, value_); }

 private:
  SeriesProgram& program_;
  const double value_;
};

/// The variables t, x, y, e, and their formulas.
class Formulas {
 public:
  Formulas() {
    const char* const names[] = {"t", "x", "y", "e"};
    for (std::size_t i = 0; i < slots_.size(); ++i) symbols_[names[i]] = graph.variable(slots_[i]);
  }
  Node read(const std::string& text) { return parse(text, symbols_, graph, {}, {}, tables_); }

  SeriesProgram compile(const std::vector<Node>& trial, const std::vector<Node>& others = {}) {
    return SeriesProgram(graph, trial, others, slots_, kOrder);
  }
  /// Coefficients of order n of the variables.
  static void set(SeriesProgram& program, const Path& path, int n) {
    const Numbers* const parts[] = {&path.t, &path.x, &path.y, &path.e};
    for (int i = 0; i < 4; ++i) {
      const Numbers& c = *parts[i];
      const auto at = static_cast<std::size_t>(n);
      program.set(program.variable(i), n, at < c.size() ? c[at] : 0.0);
    }
  }
  static void expand(SeriesProgram& program, const Path& path) {
    for (int n = 0; n <= kOrder; ++n) expandTo(program, path, n);
  }
  /// Order n, those before it being there.
  static void expandTo(SeriesProgram& program, const Path& path, int n) {
    set(program, path, n);
    if (n == 0) {
      program.begin(Part::kGiven);
      program.begin(Part::kAccelerated);
      return;
    }
    const int acceleration = program.variable(3);
    Solved solver(program, program.coefficients(acceleration)[n]);
    program.set(acceleration, n, 0.0);
    program.extend(n, true, solver);
  }
  /// The value of `node` at s by the tape.
  double valueAt(Node node, const Path& path, double s) const {
    const auto sum = [s](const Numbers& c) {
      double value = 0.0;
      for (auto it = c.rbegin(); it != c.rend(); ++it) value = value * s + *it;
      return value;
    };
    const double x = sum(path.x);
    const double y = sum(path.y);
    const double e = sum(path.e);
    const StateView state = {sum(path.t), &x, &y, &e, nullptr, nullptr};
    double value = kNan;
    Tape(graph, {node}).evaluate(state, &value);
    return value;
  }

  Graph graph;

 private:
  std::vector<int> slots_ = {slotOf(Source::kTime), slotOf(Source::kAngle),
                             slotOf(Source::kVelocity), slotOf(Source::kAcceleration)};
  SymbolTable symbols_;
  NamedTables tables_ = makeTables();
};

/// How far the sum of a series is good to rounding: its last terms are nothing there.
double reachOf(const double* c) {
  double reach = 1.0;
  for (int n = kOrder - 5; n <= kOrder; ++n) {
    if (c[n] != 0.0) reach = std::min(reach, std::pow(1e-16 / std::abs(c[n]), 1.0 / n));
  }
  return reach;
}

/// The series of `node` is its value all along the path, ahead of s = 0 and, unless it has a kink
/// there, behind it. With a reach of a third of the radius of convergence, the coefficients count
/// up to about the order 30.
void expectSeries(const Formulas& formulas, const double* c, Node node, const Path& path,
                  const std::string& what, bool is_behind_too = true, double most = 1.0) {
  const double reach = std::min(most, reachOf(c));
  EXPECT_GT(reach, 0.05 * most) << what;
  for (const double part : {0.0, 0.3, 0.6, 1.0, -0.5, -1.0}) {
    if (part < 0.0 && !is_behind_too) continue;
    const double s = part * reach;
    double sum = 0.0;
    double size = 1.0;
    for (int n = kOrder; n >= 0; --n) {
      sum = sum * s + c[n];
      size += std::abs(c[n]) * std::pow(std::abs(s), n);
    }
    EXPECT_NEAR(sum, formulas.valueAt(node, path, s), 1e-13 * size) << what << " at s = " << s;
  }
}

void expectSeries(const std::string& text, const Path& path, bool is_behind_too = true,
                  double most = 1.0) {
  Formulas formulas;
  const Node node = formulas.read(text);
  SeriesProgram program = formulas.compile({node});
  Formulas::expand(program, path);
  expectSeries(formulas, program.coefficients(program.output(0)), node, path, text, is_behind_too,
               most);
}

// ----------------------------------------------------------------------------------- operations

TEST(Series, OfTheOperators) {
  for (const char* text : {"x+y",
                           "x-y",
                           "x*y",
                           "x/y",
                           "-x",
                           "x*x",
                           "(x+y)*(x-y)",
                           "1/x",
                           "x/(2*y)",
                           "3/(x+y)",
                           "2*x-3*y+1",
                           "(2*x)*(3*y)",
                           "(2*x+1)/(4-y)",
                           "x/x",
                           "(x+y)/(x+y)",
                           "2-x+3*y-t+x*y-t*x+y*t",
                           "x*y*t",
                           "t*t",
                           "t*x",
                           "x*t^2",
                           "(x-y)*(x-y)",
                           "x/3",
                           "(x+t)/(2*(x+t))",
                           "5*t+2",
                           "(2*x)*(2*x)",
                           "x+x",
                           "x-2*x"}) {
    expectSeries(text, Path());
  }
}

TEST(Series, OfPowers) {
  for (const char* text :
       {"x^2",         "x^3",    "x^4",     "x^5",       "x^15",    "x^16",  "x^17",
        "x^-1",        "x^-2",   "x^-3",    "x^-17",     "x^0.5",   "x^1.5", "x^-0.5",
        "x^2.7",       "x^-3.3", "y^(1/3)", "pow(x, 3)", "x^y",     "2^x",   "0.5^x",
        "(x+y)^(x-y)", "x^t",    "t^x",     "(2*x)^2",   "(x+1)^3", "x^e"}) {
    expectSeries(text, Path());
  }
  // Integers leave the sign of the base free, and a base of zero is nothing special.
  Path falling;
  falling.x = {-0.8, 0.5, 0.1};
  for (const char* text : {"x^2", "x^3", "x^7", "x^-3", "x^17"}) expectSeries(text, falling);
  Path crossing;
  crossing.x = {0.0, 0.5, 0.1};
  for (const char* text : {"x^2", "x^3", "x^4", "x^7", "x^16", "x^17", "(x-y)^20", "(2+x/9)^40"}) {
    expectSeries(text, crossing);
  }
}

TEST(Series, OfEveryFunction) {
  for (const std::string& name : functionNames()) {
    const bool has_two = name == "atan2" || name == "min" || name == "max" || name == "pow";
    const std::string arguments = name == "if"      ? "(x < y, x*y, x-y)"
                                  : name == "clamp" ? "(x*y, -0.5, 2)"
                                  : has_two         ? "(x, y)"
                                                    : "(x)";
    const bool has_one = !has_two && name != "if" && name != "clamp";
    for (const std::string& text :
         has_two   ? std::vector<std::string>{arguments, "(x*y, y+t)", "(y, x)"}
         : has_one ? std::vector<std::string>{arguments, "(0.5*x*y + 0.1*t)", "(e^2)"}
                   : std::vector<std::string>{arguments}) {
      expectSeries(name + text, Path(), true, 0.5);
    }
  }
  for (const char* text :
       {"sin(x)^2+cos(x)^2", "sin(x)*cos(y)", "sinh(x)-cosh(x)", "tanh(3*y)", "exp(-x)*exp(x)",
        "log(x*y)", "sqrt(x^2+y^2)", "atan2(-x, -y)", "atan2(x, -y)", "asin(x/2)+acos(x/2)",
        "acos(y-x)", "exp(sin(log(y)))"}) {
    expectSeries(text, Path());
  }
}

TEST(Series, OfDerivatives) {
  for (const char* text : {"x/y", "x^y", "tanh(x*y)", "atan2(x, y)", "sqrt(x)*log(y)", "asin(x/2)",
                           "1/(1+exp(-5*x))", "level(x)", "straight(x*y)", "level_map(x, y)",
                           "straight_map(x, y*x)", "abs(x)*x", "min(x*x, y)"}) {
    Formulas formulas;
    const Node whole = formulas.read(text);
    for (const Source source : {Source::kAngle, Source::kVelocity}) {
      const Node node = formulas.graph.differentiate(whole, slotOf(source));
      SeriesProgram program = formulas.compile({node});
      Path path;
      path.x = {0.55, 0.1, -0.05};
      path.y = {0.6, -0.1, 0.05};
      Formulas::expand(program, path);
      expectSeries(formulas, program.coefficients(program.output(0)), node, path,
                   std::string("a derivative of ") + text, true, 0.2);
    }
  }
}

TEST(Series, OfConstantsEndAtOnce) {
  Formulas formulas;
  const std::vector<Node> nodes = {formulas.read("2*3+sin(1)"), formulas.read("x"),
                                   formulas.read("sign(x)")};
  SeriesProgram program = formulas.compile(nodes);
  Formulas::expand(program, Path());
  EXPECT_TRUE(program.isConstant(program.output(0)));
  EXPECT_EQ(program.coefficients(program.output(0))[0], 6.0 + std::sin(1.0));
  EXPECT_FALSE(program.isConstant(program.output(1)));
  EXPECT_EQ(program.output(1), program.variable(1)) << "a variable is its own row";
  EXPECT_TRUE(program.isConstant(program.output(2)));
}

// -------------------------------------------------------------------------------------- branches

/// A motion that begins on a switching surface takes the mode that it moves into.
TEST(Series, OnAnEdgeGoIntoTheDirectionOfTheMotion) {
  for (const Numbers& way :
       {Numbers{0.0, 0.5, 0.3}, Numbers{0.0, -0.5, 0.3}, Numbers{0.0, 0.0, 0.4, 1.0},
        Numbers{0.0, 0.0, -0.4, 1.0}, Numbers{0.0, 0.0, 0.0, -0.7}}) {
    Path path;
    path.x = way;
    for (const char* text : {"abs(x)", "x*abs(x)", "abs(x)*y", "max(x, 0)", "min(0, x)",
                             "max(y*x, -x)", "if(x < 0, 3*x, x*y)", "if(0 <= x, 3*x, x*y)",
                             "clamp(x, 0, 2)", "clamp(x, -2, 0)", "sqrt(1+abs(x))"}) {
      expectSeries(text, path, false, 0.3);
    }
  }
}

TEST(Series, AwayFromEdgesStayOnTheirBranch) {
  for (const double x : {-0.6, 0.6}) {
    Path path;
    path.x = {x, 0.5, 0.3};
    for (const char* text : {"abs(x)", "max(x, 0)", "min(x, y)", "if(x < 0, x^2, y)", "sign(x)",
                             "clamp(x, -0.5, 0.5)", "if(x > 0, exp(y), y)"}) {
      expectSeries(text, path, true, 0.1);
    }
  }
}

// On the edge of a jump the value is that of the formula there, and so is the branch.
TEST(Series, OnAJumpAreThoseOfTheFormulasBranch) {
  for (const double speed : {0.5, -0.5}) {
    Path path;
    path.x = {0.0, speed};
    Formulas formulas;
    SeriesProgram program =
        formulas.compile({formulas.read("if(x <= 0, 1+t, 5)"), formulas.read("sign(x)")});
    Formulas::expand(program, path);
    const double* const c = program.coefficients(program.output(0));
    EXPECT_EQ(c[0], 1.3);
    EXPECT_EQ(c[1], 1.0);
    EXPECT_EQ(program.coefficients(program.output(1))[0], 0.0);
  }
}

TEST(Series, WhereAFormulaHasNoneAreNotFinite) {
  for (const char* text : {"sqrt(x)", "log(x)", "x^1.5", "1/x", "x^-2", "asin(1+x)", "x^y",
                           "atan2(x, x)", "abs(x)/x", "1/(1/x)", "atan(1/x)"}) {
    Formulas formulas;
    SeriesProgram program = formulas.compile({formulas.read(text)});
    Path path;
    path.x = {0.0, 0.5, 0.2};
    Formulas::expand(program, path);
    const double* const c = program.coefficients(program.output(0));
    EXPECT_FALSE(std::isfinite(c[1])) << text;
    // `clear` removes their coefficients.
    program.clear();
    const Node node = formulas.read(text);
    path.x = {0.6, -0.2, 0.1};
    if (std::string(text) == "asin(1+x)") path.x[0] = -0.9;
    Formulas::expand(program, path);
    expectSeries(formulas, program.coefficients(program.output(0)), node, path, text);
  }
}

TEST(Series, OfANotANumberAreNone) {
  for (const char* text : {"abs(log(x))", "min(log(x), 1)", "max(1, log(x))",
                           "if(log(x) < 1, 2, 3)", "sign(log(x))"}) {
    Formulas formulas;
    SeriesProgram program = formulas.compile({formulas.read(text)});
    Path path;
    path.x = {-0.5, 0.1};
    Formulas::expand(program, path);
    EXPECT_TRUE(std::isnan(program.coefficients(program.output(0))[0])) << text;
  }
}

// A part that overflows counts nothing in a function that has a limit there.
TEST(Series, WhereAPartOverflowsStayAtTheLimit) {
  Path path;
  path.x = {9.0, 0.5, -0.2};
  for (const char* text :
       {"1/(1+exp(100*x))", "y/exp(200*x)", "tanh(exp(100*x))", "atan(exp(100*x))",
        "exp(-exp(100*x))", "y+x/(2+cosh(90*x))", "exp(100*x)^-2", "exp(100*x)^-0.5",
        "atan2(y, exp(100*x))", "atan2(sinh(-100*x), y)", "min(y, exp(100*x))"}) {
    expectSeries(text, path, true, 0.3);
  }
}

// A branch that is not taken may be anything.
TEST(Series, OfTheBranchTakenDoNotSeeTheOther) {
  Path path;
  path.x = {0.0, 0.5, 0.2};
  for (const char* text : {"if(x < 1, y*x, sqrt(x-2))", "if(x > -1, y, 1/x)",
                           "if(y < 0, log(x), x*x)", "min(y, 2+1e300*1e10^(300*y))"}) {
    expectSeries(text, path, true, 0.3);
  }
}

// ---------------------------------------------------------------------------------------- tables

TEST(Series, OfTablesAtPointsBetweenAndBeyond) {
  const std::vector<std::string> names = {"level", "straight"};
  for (const double x : {-0.5, 0.0, 0.2, 0.4, 0.7, 1.0, 1.7, 2.4}) {
    for (const double speed : {0.3, -0.3, 0.0}) {
      Path path;
      path.x = {x, speed, speed == 0.0 ? -0.2 : 0.1, 0.05};
      const bool is_smooth = x == -0.5 || x == 0.2 || x == 0.7 || x == 2.4;
      for (const std::string& name : names) {
        expectSeries(name + "(x)", path, is_smooth, 0.3);
        expectSeries("e*" + name + "(x)", path, is_smooth, 0.3);
        // A table of an acceleration.
        Path swapped = path;
        std::swap(swapped.x, swapped.e);
        expectSeries(name + "(e)", swapped, is_smooth, 0.3);
        Formulas formulas;
        const Node slope =
            formulas.graph.differentiate(formulas.read(name + "(x)"), slotOf(Source::kAngle));
        SeriesProgram program = formulas.compile({slope});
        Formulas::expand(program, path);
        expectSeries(formulas, program.coefficients(program.output(0)), slope, path,
                     "the slope of " + name + " at " + std::to_string(x), is_smooth, 0.3);
      }
    }
  }
}

TEST(Series, OfTablesOfTwo) {
  for (const double x : {-0.5, 0.4, 0.7, 1.7, 2.4}) {
    for (const double y : {-1.5, -1.0, 0.0, 0.5, 2.0, 3.0}) {
      for (const auto& [vx, vy] : {std::pair{0.3, 0.2}, {-0.3, 0.2}, {0.3, -0.2}, {-0.3, -0.2}}) {
        Path path;
        path.x = {x, vx, 0.1, 0.05};
        path.y = {y, vy, -0.1};
        const bool is_smooth = x != 0.4 && x != 1.7 && y != -1.0 && y != 0.5 && y != 2.0;
        for (const char* text : {"level_map(x, y)", "straight_map(x, y)", "t*level_map(x, y)"}) {
          expectSeries(text, path, is_smooth, 0.3);
        }
      }
    }
  }
}

// Along one axis only, from a point of the other: which side it is on there is decided later.
TEST(Series, OfTablesOfTwoThatMoveAlongOneAxisFirst) {
  for (const Numbers& way : {Numbers{0.0, 0.0, 0.2}, Numbers{0.0, 0.0, -0.2}, Numbers{0.0}}) {
    for (const double speed : {0.3, -0.3}) {
      Path path;
      path.x = way;
      path.x[0] = 0.4;
      path.y = {0.0, speed, 0.1};
      expectSeries("straight_map(x, y)", path, false, 0.3);
      path.y = way;
      path.y[0] = 0.5;
      path.x = {0.7, speed, 0.1};
      expectSeries("straight_map(x, y)", path, false, 0.3);
    }
  }
}

// ------------------------------------------------------------------------------------- the parts

/// Order by order, with the accelerations tried as 0 first: the same as evaluated whole.
TEST(Series, AreTheSameWhereAccelerationsAreTriedFirst) {
  const std::vector<std::string> texts = {
      "sin(e)*x",          "e^2+e*y", "abs(e)*tanh(x)", "level(e)+e",        "straight_map(x, e)",
      "min(e, x)",         "x*y",     "exp(e*t)",       "sqrt(2+e)/(3+e*e)", "atan2(e, 2)",
      "if(e < 5, e*e, x)", "cosh(e)", "(1.5+e)^2.5"};
  Formulas formulas;
  std::vector<Node> trial;
  std::vector<Node> others;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    (i % 2 == 0 ? trial : others).push_back(formulas.read(texts[i]));
  }
  std::vector<Node> all = trial;
  all.insert(all.end(), others.begin(), others.end());
  SeriesProgram whole = formulas.compile({}, all);  // nothing is tried
  SeriesProgram tried = formulas.compile(trial, others);
  const Path path;
  Formulas::expand(whole, path);
  const int acceleration = 3;
  for (int n = 0; n <= kOrder; ++n) {
    SeriesProgram before = tried;
    SeriesProgram zero = tried;
    Formulas::expandTo(tried, path, n);
    if (n == 0) continue;
    // The first outputs know the trial value while the acceleration is solved for.
    for (SeriesProgram* program : {&before, &zero}) {
      Formulas::set(*program, path, n);
      program->set(program->variable(acceleration), n, 0.0);
      Solved nothing(*program, 0.0);
      program->extend(n, program == &zero, nothing);
    }
    for (int i = 0; i < static_cast<int>(trial.size()); ++i) {
      EXPECT_EQ(before.coefficients(before.output(i))[n], zero.coefficients(zero.output(i))[n]);
    }
  }
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const int row = static_cast<int>(i);
    const double* const a = whole.coefficients(whole.output(row));
    const double* const b = tried.coefficients(tried.output(row));
    for (int n = 0; n <= kOrder; ++n) {
      EXPECT_NEAR(a[n], b[n], 1e-12 * (std::abs(a[n]) + std::abs(a[n / 2])))
          << "output " << row << ", order " << n;
    }
  }
  EXPECT_TRUE(whole.isAccelerated(whole.output(0)));
  EXPECT_FALSE(whole.isAccelerated(whole.output(3))) << "x*y, which stands fourth";
}

/// A shorter expansion after a longer one: what that left behind is not read.
TEST(Series, DoNotReadWhatAnEarlierMotionLeft) {
  Formulas formulas;
  const std::vector<Node> nodes = {
      formulas.read("x*y"),           formulas.read("x/y"),
      formulas.read("exp(x)*sin(y)"), formulas.read("level(x)"),
      formulas.read("x^2.5"),         formulas.read("sqrt(x)*log(y)"),
      formulas.read("atan2(x, y)"),   formulas.read("tan(x)"),
      formulas.read("abs(x-y)"),      formulas.read("level_map(x, y)")};
  SeriesProgram used = formulas.compile(nodes);
  Path wild;
  wild.x = {0.2, 30.0, -50.0, 70.0};
  wild.y = {1.3, 20.0, 10.0, -40.0};
  Formulas::expand(used, wild);
  const Path path;
  SeriesProgram fresh = formulas.compile(nodes);
  for (int n = 0; n <= 9; ++n) {
    for (SeriesProgram* program : {&used, &fresh}) {
      Formulas::expandTo(*program, path, n);
    }
    for (int i = 0; i < static_cast<int>(nodes.size()); ++i) {
      EXPECT_EQ(used.coefficients(used.output(i))[n], fresh.coefficients(fresh.output(i))[n])
          << "output " << i << ", order " << n;
    }
  }
}

/// A function that has reached its limit changes no more, whatever it did in an earlier motion.
TEST(Series, ChangeNothingAtALimit) {
  Formulas formulas;
  const std::vector<Node> nodes = {formulas.read("x*atan(exp(800*e))")};
  SeriesProgram used = formulas.compile(nodes);
  Path below;
  below.e[0] = 0.001;
  for (int n = 0; n <= 3; ++n) Formulas::expandTo(used, below, n);  // e_3 changes it
  Path at_limit;
  at_limit.e[0] = 2.0;
  SeriesProgram fresh = formulas.compile(nodes);
  for (int n = 0; n <= 9; ++n) {
    for (SeriesProgram* program : {&used, &fresh}) Formulas::expandTo(*program, at_limit, n);
    const double expected =
        n < 4 ? std::atan(1.0) * 2.0 * at_limit.x[static_cast<std::size_t>(n)] : 0.0;
    EXPECT_DOUBLE_EQ(fresh.coefficients(fresh.output(0))[n], expected) << "order " << n;
    EXPECT_DOUBLE_EQ(used.coefficients(used.output(0))[n], expected) << "order " << n;
  }
}

}  // namespace
}  // namespace variator_sim::expression
