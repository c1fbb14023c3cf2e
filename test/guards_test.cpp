// Guards of formulas: what they tell of a box of states has to hold at every state in it, and may
// not be so cautious that it says nothing.
#include "variator_sim/expression/guards.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "integrate/guard_search.h"
#include "integrate/step_curve.h"
#include "variator_sim/expression/parser.h"
#include "variator_sim/expression/tape.h"
#include "variator_sim/interruption.h"

namespace variator_sim::expression {
namespace {

/// Two shafts and the time.
struct Symbols {
  Symbols() {
    table["t"] = graph.variable(slotOf(Source::kTime, 0));
    for (int i = 0; i < 2; ++i) {
      const std::string n = std::to_string(i + 1);
      table["phi" + n] = graph.variable(slotOf(Source::kAngle, i));
      table["w" + n] = graph.variable(slotOf(Source::kVelocity, i));
      table["e" + n] = graph.variable(slotOf(Source::kAcceleration, i));
    }
  }
  std::vector<GuardPtr> guardsOf(const std::string& text) {
    return findGuards(graph, {parse(text, table, graph)});
  }
  Graph graph;
  SymbolTable table;
};

struct State {
  double time = 0.0;
  double angle[2] = {};
  double velocity[2] = {};
  double acceleration[2] = {};
  StateView view() const { return {time, angle, velocity, acceleration, nullptr, nullptr}; }
};

/// A state anywhere in `box`, on its faces more often than not.
State stateIn(const StateBox& box, std::mt19937& random) {
  std::uniform_real_distribution<double> part(-0.5, 1.5);
  const auto within = [&](const Interval& range) {
    const double x = range.low + part(random) * (range.high - range.low);
    return std::min(std::max(x, range.low), range.high);
  };
  State state;
  state.time = within(box.time);
  for (int i = 0; i < 2; ++i) {
    state.angle[i] = within(box.angle[i]);
    state.velocity[i] = within(box.velocity[i]);
    state.acceleration[i] = within(box.acceleration[i]);
  }
  return state;
}

StateBox boxAround(double size, std::mt19937& random) {
  std::uniform_real_distribution<double> centre(-3.0, 3.0);
  std::uniform_real_distribution<double> width(0.0, size);
  const auto any = [&] {
    const double x = centre(random);
    return Interval{x, x + width(random)};
  };
  StateBox box;
  box.time = any();
  for (int i = 0; i < 2; ++i) {
    box.angle[i] = any();
    box.velocity[i] = any();
    box.acceleration[i] = any();
  }
  return box;
}

/// Arguments that use every function of formulas, some only where they exist.
const char* const kArguments[] = {
    "w1-w2",
    "phi1*w2-0.3",
    "w1/(2+w2)",
    "1/w1-w2",
    "sin(3*phi1)+0.2",
    "cos(phi1-phi2)-0.5*w1",
    "tan(0.4*phi1)-w2",
    "asin(0.3*w1)-0.2*w2",
    "acos(0.3*w1)-1",
    "atan(w1)-0.3*e1",
    "atan2(w1,w2)-0.4",
    "sinh(w1)-w2",
    "cosh(w1)-2",
    "tanh(5*w1)+0.5*w2",
    "exp(w1)-2*w2",
    "log(4+w1)-1.2",
    "sqrt(3+w1)-1.5",
    "(2+0.5*w1)^1.7-2*w2",
    "w1^2-w2",
    "w1^3-w2^2",
    "w1^(-2)-1",
    "abs(w1)-1",
    "min(w1,phi2)+max(e1,t)",
    "sign(w1)*w2-0.3",
    "e1-0.5*e2+0.1*t",
    "t-0.7",
};

TEST(GuardsOfFormulas, EncloseEveryStateOfABox) {
  std::mt19937 random(7);
  int told = 0;
  int boxes = 0;
  for (const char* argument : kArguments) {
    int told_here = 0;
    for (const char* law : {"abs(X)", "sign(X)", "min(X,0.25)", "max(0,X)"}) {
      std::string text = law;
      text.replace(text.find('X'), 1, "(" + std::string(argument) + ")");
      Symbols symbols;
      for (const GuardPtr& guard : symbols.guardsOf(text)) {
        for (double size : {1e-9, 1e-3, 0.1, 1.0, 4.0}) {
          for (int n = 0; n < 40; ++n) {
            const StateBox box = boxAround(size, random);
            const int branch = guard->branch(stateIn(box, random).view());
            if (branch == Guard::kOnEdge) continue;
            ++boxes;
            if (guard->mayLeave(box, branch)) continue;
            ++told_here;
            for (int m = 0; m < 60; ++m) {
              const State state = stateIn(box, random);
              ASSERT_EQ(guard->branch(state.view()), branch)
                  << text << ", size " << size << ", t " << state.time << ", w1 "
                  << state.velocity[0] << ", w2 " << state.velocity[1];
            }
          }
        }
      }
    }
    EXPECT_GT(told_here, 100) << argument;
    told += told_here;
  }
  EXPECT_GT(told, boxes / 2);
}

// An enclosure shrinks with its box: near a state that is off the edge a small one always tells.
TEST(GuardsOfFormulas, TellOfSmallBoxes) {
  std::mt19937 random(8);
  for (const char* argument : kArguments) {
    Symbols symbols;
    const std::vector<GuardPtr> guards = symbols.guardsOf("abs(" + std::string(argument) + ")");
    ASSERT_FALSE(guards.empty()) << argument;
    for (const GuardPtr& guard : guards) {
      int told = 0;
      int all = 0;
      for (int n = 0; n < 200; ++n) {
        const StateBox box = boxAround(1e-8, random);
        const int branch = guard->branch(stateIn(box, random).view());
        if (branch == Guard::kOnEdge) continue;  // where the formula is not defined, too
        ++all;
        told += guard->mayLeave(box, branch) ? 0 : 1;
      }
      EXPECT_GE(told, all - all / 50) << argument;
    }
  }
}

TEST(GuardsOfFormulas, AreOneForEachArgument) {
  Symbols symbols;
  EXPECT_EQ(symbols.guardsOf("abs(w1)+abs(w1)+sign(w1)").size(), 1U);
  EXPECT_TRUE(symbols.guardsOf("abs(w1)+sign(w1)")[0]->jumps());
  EXPECT_FALSE(symbols.guardsOf("max(w1,w2)")[0]->jumps());
  EXPECT_EQ(symbols.guardsOf("max(w1,min(w2,3))").size(), 2U);
  EXPECT_TRUE(symbols.guardsOf("sin(w1)*w2").empty());
  EXPECT_TRUE(symbols.guardsOf("abs(-3)*w2").empty());
}

/// May leave its branch in all but the shortest times, and notes how often it is asked.
class Tireless final : public Guard {
 public:
  explicit Tireless(int* asked) : Guard(false), asked_(asked) {}
  int branch(const StateView& /*state*/) const override { return 1; }
  bool mayLeave(const StateBox& box, int /*branch*/) const override {
    ++*asked_;
    return box.time.high - box.time.low > 1e-5;
  }

 private:
  int* asked_;
};

/// A search along given angles and velocities of two shafts.
class Searched {
 public:
  explicit Searched(std::vector<GuardPtr> guards) {
    search_.setGuards(
        std::move(guards),
        [](double time, const double* p, const double* w, const double* e) {
          return StateView{time, p, w, e, nullptr, nullptr};
        },
        [](const Interval&, Interval*) {});
  }
  /// `x(part)` gives phi and omega at a part of the step from 1 s to 1.5 s.
  template <class Curve>
  GuardFinding along(const Curve& x) {
    constexpr double kDuration = 0.5;
    StepCurve curve;
    curve.begin(1.0, kDuration, 2, false);
    for (int n = 0; n < StepCurve::kNodes; ++n) curve.setNode(n, x(StepCurve::node(n)).data());
    curve.finish();
    double angle[2];
    double velocity[2];
    double acceleration[2];
    curve.evaluate(0.0, angle, velocity, acceleration);
    search_.moveBase({1.0, angle, velocity, acceleration, nullptr, nullptr});
    return search_.find(curve, 1e-13);
  }

 private:
  GuardSearch search_;
};

// A linear guard is a polynomial whose roots are isolated; the same guard, written so that it does
// not seem linear, is enclosed over boxes. Both find the first crossing, and where there is none
// neither does.
TEST(GuardSearches, FindTheSameByPolynomialsAndByBoxes) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  int crossings = 0;
  int clear = 0;
  for (const std::string argument :
       {"w1-w2", "2*w1-0.3", "-phi1/3+0.1", "0.4*e1-w2", "t-1.25+0.1*w1", "w1-(0.2*t+phi2)"}) {
    Symbols symbols;
    Searched by_polynomial(symbols.guardsOf("sign(" + argument + ")"));
    Searched by_boxes(symbols.guardsOf("sign(" + argument + "+0*phi1^2)"));
    for (int n = 0; n < 300; ++n) {
      double c[4][5];
      for (auto& row : c) {
        for (double& value : row) value = any(random);
      }
      const auto x = [&](double part) {
        std::array<double, 4> values{};
        for (std::size_t i = 0; i < 4; ++i) {
          values[i] = c[i][0] + c[i][1] * part + c[i][2] * std::sin(6.0 * part + c[i][3]);
        }
        return values;
      };
      const GuardFinding a = by_polynomial.along(x);
      const GuardFinding b = by_boxes.along(x);
      ASSERT_EQ(a.kind, b.kind) << argument << ", " << n;
      EXPECT_NEAR(a.clear, b.clear, 1e-12) << argument << ", " << n;
      EXPECT_NEAR(a.beyond, b.beyond, 1e-12) << argument << ", " << n;
      ++(a.kind == GuardFinding::Kind::kCrossing ? crossings : clear);
    }
  }
  EXPECT_GT(crossings, 500);
  EXPECT_GT(clear, 500);
}

// A parabola that dips below an edge for 1e-5 of the step crosses it, one that stays above by
// little more than rounding does not.
TEST(GuardSearches, SeeTheBriefestDipAndNoTouch) {
  Symbols symbols;
  Searched search(symbols.guardsOf("max(w1,0)"));
  const auto dips = [](double least) {
    return [least](double part) {
      const double off = part - 0.3;
      return std::array<double, 4>{0.0, 0.0, off * off + least, 0.0};
    };
  };
  const GuardFinding dip = search.along(dips(-2.5e-11));
  EXPECT_EQ(dip.kind, GuardFinding::Kind::kCrossing);
  EXPECT_NEAR(dip.clear, 0.3 - 5e-6, 1e-9);
  EXPECT_LE(dip.beyond, 0.3);
  EXPECT_EQ(search.along(dips(1e-13)).kind, GuardFinding::Kind::kClear);
}

TEST(GuardSearches, EndSoonWhereTheyAreInterrupted) {
  int asked = 0;
  Searched search({std::make_shared<Tireless>(&asked)});
  const Interruption interruption([] { return true; });
  const auto still = [](double) { return std::array<double, 4>{}; };
  EXPECT_EQ(search.along(still).kind, GuardFinding::Kind::kUnknown);
  EXPECT_LT(asked, 200);
}

// However many there are, a step is searched within bounded time: the rest of it is another step's.
TEST(GuardSearches, AskGuardsABoundedNumberOfTimes) {
  int asked = 0;
  GuardSearch search;
  search.setGuards(
      std::vector<GuardPtr>(500, std::make_shared<Tireless>(&asked)),
      [](double time, const double* p, const double* w, const double* e) {
        return StateView{time, p, w, e, nullptr, nullptr};
      },
      [](const Interval&, Interval*) {});
  const double x[3] = {};
  search.moveBase({0.0, x, x + 1, x + 2, nullptr, nullptr});
  StepCurve curve;
  curve.begin(0.0, 1.0, 1, false);
  for (int n = 0; n < StepCurve::kNodes; ++n) curve.setNode(n, x);
  curve.finish();
  const GuardFinding finding = search.find(curve, 1e-9);
  EXPECT_EQ(finding.kind, GuardFinding::Kind::kUnknown);
  EXPECT_GT(finding.clear, 0.0);
  EXPECT_LT(asked, 1500000);
}

}  // namespace
}  // namespace variator_sim::expression
