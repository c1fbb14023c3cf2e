// A motion's power series: the series of each torque against the value of its formula where the
// motion's own series has come to, as the tape computes it.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dynamics/system.h"
#include "support/scenes.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim {
namespace {

/// The series of a motion of three shafts, which a constraint of accelerations couples, from a
/// state whose angle and velocity of shaft a are given.
class Expansion {
 public:
  Expansion(const std::string& formula, double angle, double velocity)
      : scene_(test::sceneFromText(R"yaml(
shafts: [a, b, c]
a: {inertia: 1.3}
b: {inertia: 0.7}
c: {inertia: 0.9}
tables: [level]
level: {x: [0, 0.4, 1, 1.7], values: [1, 2.5, 3, -1]}
torques: [asked, motor, load]
asked: {type: variator_sim/ExpressionTorque, shaft: c, torque: ")yaml" +
                                   formula + R"yaml("}
motor: {type: variator_sim/ExpressionTorque, shaft: a, torque: "0.4 - 0.3*w_a + 0.2*sin(3*t)"}
load: {type: variator_sim/ExpressionTorque, shaft: b, torque: "-0.5*w_b - 0.1*phi_b"}
constraints: [variator]
variator: {type: variator_sim/ExpressionConstraint, order: 2, expression: "e_b - 0.6*e_a + 0.1*w_a*w_b"}
solver: {stepper: taylor, relative_tolerance: 1e-12, absolute_tolerance: 1e-12}
)yaml")),
        system_(scene_),
        x_{angle, 1.1, 0.6, velocity, -0.4, 0.3, 0.45, 0.27 - 0.1 * velocity * -0.4, -0.2} {}

  bool expand(double limit) {
    return system_.series()->expand({0.3, 0.0, x_.data(), nullptr}, 0.0, limit, &shown_);
  }
  /// The largest difference between the series of the asked torque and its formula up to the
  /// length that a step may have, for size 1.
  double worst(double part) {
    double worst = 0.0;
    for (const double share : {0.0, 0.3, 0.7, 1.0}) {
      const double s = share * part * shown_.length;
      double x[9], torque[3];
      for (int n = 0; n < 9; ++n) x[n] = sum(shown_.rows[n], s);
      const StateView view = system_.drivetrain().view(0.3 + s, x, x + 3, x + 6);
      system_.drivetrain().calcTorque(view, torque);
      const double error = std::abs(sum(shown_.rows[11], s) - torque[2]);
      worst = std::max(worst, std::isnan(error) ? INFINITY : error / (1.0 + std::abs(torque[2])));
    }
    return worst;
  }
  double length() const { return shown_.length; }
  const double* asked() const { return shown_.rows[11]; }

 private:
  double sum(const double* c, double s) const {
    double value = 0.0;
    for (int n = shown_.last; n >= 0; --n) value = value * (s / shown_.unit) + c[n];
    return value;
  }

  const Scene scene_;
  System system_;
  std::vector<double> x_;
  const double* rows_[12] = {};
  vs_shown shown_ = {rows_, 0, 0.0, 0.0, 0.0};
};

void expectSeries(const std::string& text, double angle = 0.7, double velocity = 0.5,
                  double limit = 0.05) {
  SCOPED_TRACE(text);
  Expansion expansion(text, angle, velocity);
  ASSERT_TRUE(expansion.expand(limit));
  EXPECT_GT(expansion.length(), 0.0);
  EXPECT_LT(expansion.worst(std::min(1.0, limit / expansion.length())), 1e-11);
}

/// x and y of a formula are an angle and a velocity of another shaft.
std::string withNames(std::string text) {
  std::string made;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_alone =
        (i == 0 || !std::isalnum(static_cast<unsigned char>(text[i - 1]))) &&
        (i + 1 == text.size() || !std::isalnum(static_cast<unsigned char>(text[i + 1])));
    made += text[i] == 'x' && is_alone   ? "phi_a"
            : text[i] == 'y' && is_alone ? "(1.7+w_b)"
                                         : std::string(1, text[i]);
  }
  return made;
}

TEST(Series, OfOperatorsAndPowers) {
  for (const char* text : {"x+y",
                           "x*y",
                           "x/y",
                           "(x+y)*(x-y)",
                           "3/(x+y)",
                           "(2*x+1)/(4-y)",
                           "(x+y)/(x+y)",
                           "x*t^2",
                           "2-x+3*y-t+x*y-t*x+y*t",
                           "(x+t)/(2*(x+t))",
                           "x^2",
                           "x^5",
                           "x^16",
                           "x^17",
                           "x^-3",
                           "x^-17",
                           "x^0.5",
                           "x^-0.5",
                           "x^2.7",
                           "x^-3.3",
                           "x^y",
                           "2^x",
                           "(x+y)^(x-y)",
                           "t^x",
                           "(x-y)^20"}) {
    expectSeries(withNames(text));
  }
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

// On the edge of a jump the value is that of the formula there, and so is the branch.
TEST(Series, OnAJumpAreThoseOfTheFormulasBranch) {
  for (const double speed : {0.5, -0.5}) {
    Expansion expansion("if(phi_a <= 0, 1+t, 5)", 0.0, speed);
    ASSERT_TRUE(expansion.expand(0.01));
    EXPECT_EQ(expansion.asked()[0], 1.3);
    EXPECT_GT(expansion.asked()[1], 0.0);
  }
}

TEST(Series, WhereAFormulaHasNoneAreNone) {
  for (const char* text : {"sqrt(phi_a)", "log(phi_a)", "phi_a^1.5", "1/phi_a", "asin(1+phi_a)"}) {
    Expansion expansion(text, 0.0, 0.5);
    const bool is_finite = expansion.expand(0.01) && std::isfinite(expansion.asked()[0]) &&
                           std::isfinite(expansion.asked()[1]) &&
                           std::isfinite(expansion.asked()[2]);
    EXPECT_FALSE(is_finite) << text;
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
