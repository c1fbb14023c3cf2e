// A motion's power series: the acceleration of a shaft that a torque alone turns is the sum of the
// torque's series, and the torque itself that of its formula at the state there.

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim {
namespace {

/// `text` with `by` for each `letter` that is a name of its own.
std::string withFor(const std::string& text, char letter, const std::string& by) {
  std::string made;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_alone =
        (i == 0 || !std::isalnum(static_cast<unsigned char>(text[i - 1]))) &&
        (i + 1 == text.size() || !std::isalnum(static_cast<unsigned char>(text[i + 1])));
    made += text[i] == letter && is_alone ? by : std::string(1, text[i]);
  }
  return made;
}

/// A motion of three shafts, the first two of which a constraint of accelerations couples, from a
/// state whose angle and velocity of shaft a are given. The time of the formula begins at 0.3 s: no
/// power of it is without a series there.
class Expansion {
 public:
  Expansion(const std::string& formula, double angle, double velocity)
      : simulation_(test::sceneFromText(
            "a 1.3, b 0.7, c 0.9",
            {"asked on c: " + withFor(formula, 't', "(t+0.3)"),
             "motor on a: 0.4 - 0.3*w_a + 0.2*sin(3*t)", "load on b: -0.5*w_b - 0.1*phi_b",
             "variator: e_b - 0.6*e_a + 0.1*w_a*w_b"},
            "tables: [level]\nlevel: {x: [0, 0.4, 1, 1.7], values: [1, 2.5, 3, -1]}\n"
            "initial: {angle: [" +
                std::to_string(angle) + ", 1.1, 0.6], velocity: [" + std::to_string(velocity) +
                ", -0.4, 0.3]}\n"
                "solver: {stepper: taylor, relative_tolerance: 1e-12, "
                "absolute_tolerance: 1e-12}")) {}

  /// The largest difference between J epsilon and the asked torque up to `end` s, for size 1; a
  /// number that is not finite where the motion does not get there.
  double worst(double end) {
    double worst = 0.0;
    for (const double share : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0}) {
      if (!simulation_.advanceTo(share * end).ok()) return INFINITY;
      const Sample& s = simulation_.sample();
      worst =
          std::max(worst, std::abs(s.reaction_torque[2]) / (1.0 + std::abs(s.applied_torque[2])));
    }
    return worst;
  }
  double asked() { return simulation_.sample().applied_torque[2]; }

 private:
  Simulation simulation_;
};

void expectSeries(const std::string& text, double angle = 0.7, double velocity = 0.5,
                  double limit = 0.05) {
  SCOPED_TRACE(text);
  EXPECT_LT(Expansion(text, angle, velocity).worst(limit), 1e-11);
}

/// x and y of a formula are an angle and a velocity of another shaft.
std::string withNames(const std::string& text) {
  return withFor(withFor(text, 'x', "phi_a"), 'y', "(1.7+w_b)");
}

TEST(Series, OfOperatorsAndPowers) {
  const std::string texts =
      "x+y x*y x/y (x+y)*(x-y) 3/(x+y) (2*x+1)/(4-y) (x+y)/(x+y) x*t^2 2-x+3*y-t+x*y-t*x+y*t "
      "(x+t)/(2*(x+t)) x^2 x^5 x^16 x^17 x^-3 x^-17 x^0.5 x^-0.5 x^2.7 x^-3.3 x^y 2^x (x+y)^(x-y) "
      "t^x (x-y)^20";
  for (const std::string& text : test::split(texts, " ")) expectSeries(withNames(text));
}

TEST(Series, OfEveryFunction) {
  for (const std::string& name : expression::functionNames()) {
    const bool has_two = name == "atan2" || name == "min" || name == "max" || name == "pow";
    const std::string arguments = name == "if"      ? "(x < y, x*y, x-y)"
                                  : name == "clamp" ? "(x*y, -0.5, 2)"
                                  : has_two         ? "(x, y)"
                                                    : "(x)";
    expectSeries(withNames(name + arguments));
    if (has_two) expectSeries(withNames(name + "(x*y, y+t)"));
    if (arguments == "(x)") expectSeries(withNames(name + "(0.3*x*y + 0.1*t)"));
  }
  for (const char* text : {"sin(x)*cos(y)", "tanh(3*y)", "log(x*y)", "sqrt(x^2+y^2)",
                           "atan2(-x, -y)", "asin(x/2)+acos(x/2)", "exp(sin(log(y)))"}) {
    expectSeries(withNames(text));
  }
}

TEST(Series, OnAnEdgeGoIntoTheDirectionOfTheMotion) {
  for (const double speed : {0.5, -0.5}) {
    for (const char* text : {"abs(x)", "x*abs(x)", "max(x, 0)", "min(0, x)", "max(y*x, -x)",
                             "clamp(x, 0, 2)", "clamp(x, -2, 0)", "sqrt(1+abs(x))"}) {
      expectSeries(withNames(text), 0.0, speed);
    }
  }
}

// On the edge of a jump the value is that of the formula there.
TEST(Series, OnAJumpAreThoseOfTheFormulasBranch) {
  for (const double speed : {0.5, -0.5}) {
    EXPECT_EQ(Expansion("if(phi_a <= 0, 1+t, 5)", 0.0, speed).asked(), 1.3);
  }
}

TEST(Series, WhereAFormulaHasNoneAreNone) {
  for (const char* text : {"sqrt(phi_a)", "log(phi_a)", "1/phi_a", "asin(1+phi_a)"}) {
    EXPECT_FALSE(Expansion(text, 0.0, 0.5).worst(0.01) < 1e-3) << text;
  }
}

// A part that overflows counts nothing in a function that has a limit there.
TEST(Series, WhereAPartOverflowsStayAtTheLimit) {
  for (const char* text : {"1/(1+exp(100*x))", "y/exp(200*x)", "tanh(exp(100*x))",
                           "atan(exp(100*x))", "exp(-exp(100*x))", "y+x/(2+cosh(90*x))"}) {
    expectSeries(withNames(text), 9.0);
  }
}

TEST(Series, OfTheBranchTakenDoNotSeeTheOther) {
  for (const char* text : {"if(x < 1, y*x, sqrt(x-2))", "if(x > -1, y, 1/x)"}) {
    expectSeries(withNames(text), 0.0);
  }
}

TEST(Series, OfTablesAtPointsBetweenAndBeyond) {
  for (const double x : {-0.5, 0.0, 0.2, 0.4, 0.7, 1.0, 1.7, 2.4}) {
    for (const double speed : {0.3, -0.3}) {
      expectSeries(withNames("level(x)"), x, speed, 0.01);
      expectSeries(withNames("y*level(x)"), x, speed, 0.01);
    }
  }
}

}  // namespace
}  // namespace variator_sim
