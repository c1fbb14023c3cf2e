// The motion as power series: that the polynomial satisfies the equations of motion wherever it
// has converged, and goes where another stepper goes.
#include "dynamics/motion_series.h"

#include "dynamics/system.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr int kOrder = MotionSeries::kMostOrder;
constexpr double kStart = 0.37;  // s
constexpr double kSmall = 1e-12;

struct Case {
  std::string name;
  std::string text;
};

/// At `kStart` of a motion that begins with a command of 1.5 to every input.
class Expansion {
 public:
  explicit Expansion(const Scene& scene)
      : scene_(test::withStepper(test::withTolerance(scene, 1e-13), StepperKind::kFehlberg78)),
        simulation_(scene_),
        system_(scene_),
        S(scene_.shaftCount()) {
    Drivetrain& drivetrain = system_.drivetrain();
    drivetrain.resetInputs();
    for (int i = 0; i < scene_.inputCount(); ++i) {
      simulation_.command(i, 1.5);
      drivetrain.signal(i).command(scene_.inputs[static_cast<std::size_t>(i)], 0.0, 1.5);
    }
    drivetrain.saveSignals();
    drivetrain.restoreSignals(kStart);
    simulation_.advanceTo(kStart);
    const Sample& sample = simulation_.sample();
    x_.insert(x_.end(), sample.angle, sample.angle + S);
    x_.insert(x_.end(), sample.velocity, sample.velocity + S);
    x_.insert(x_.end(), sample.acceleration, sample.acceleration + S);
  }

  /// False where the scene has no series there.
  bool expand(double unit, int order) {
    unit_ = unit;
    if (system_.series() == nullptr) return false;
    if (!system_.series()->begin(kStart, x_.data(), unit, order)) return false;
    for (int n = 1; n <= order; ++n) {
      if (!system_.series()->extendTo(system_.series()->order() + 1)) return false;
    }
    return true;
  }
  /// Coefficients of angles, then velocities, then accelerations.
  const double* coefficients(int n) const {
    const MotionSeries& series = *system_.series();
    return n < S       ? series.angle(n)
           : n < 2 * S ? series.velocity(n - S)
                       : series.acceleration(n - 2 * S);
  }
  /// s up to which nothing is left out.
  double reach() const {
    double reach = 1.0;
    for (int n = 0; n < 3 * S; ++n) {
      const double* const c = coefficients(n);
      const double size = std::max(1.0, std::abs(c[0]));
      for (int k = kOrder - 3; k <= kOrder; ++k) {
        if (c[k] != 0.0) reach = std::min(reach, std::pow(1e-16 * size / std::abs(c[k]), 1.0 / k));
      }
    }
    return reach;
  }
  static double sum(const double* c, double s) {
    double sum = 0.0;
    for (int k = kOrder; k >= 0; --k) sum = sum * s + c[k];
    return sum;
  }

  /// x' of the polynomial is what the system says of x.
  void expectEquations(double s) {
    State x(system_.size());
    State dxdt(system_.size());
    for (int n = 0; n < x.size(); ++n) x[n] = sum(coefficients(n), s);
    // Under `gauss` accelerations are looked for from these on.
    for (int n = 0; n < x.size(); ++n) dxdt[n] = x_[static_cast<std::size_t>(S + n) % x_.size()];
    system_.noteBase(kStart, x, dxdt);
    system_(x, dxdt, kStart + s * unit_);
    double size = 1.0;
    for (int n = 0; n < x.size(); ++n) size = std::max({size, std::abs(x[n]), std::abs(dxdt[n])});
    for (int n = 0; n < x.size(); ++n) {
      double slope = 0.0;
      for (int k = kOrder; k > 0; --k) slope = slope * s + k * coefficients(n)[k];
      EXPECT_NEAR(slope / unit_, dxdt[n], 1e-11 * size) << "x" << n << "' at s = " << s;
    }
  }
  /// True if no input moves and the scene has such steps.
  bool makesWholeSteps() {
    const MotionSeries* const series = system_.series();
    return series != nullptr && series->makesWholeSteps() &&
           !system_.drivetrain().haveInputsMoved();
  }
  /// A whole step, which ends on the motion and tells what there is; the next one from there, too.
  void expectWholeSteps() {
    MotionSeries& series = *system_.series();
    series.keepReaction({});
    State x(system_.size());
    x.assign(x_.data());
    double t = kStart;
    double length = 0.05;
    for (int steps = 0; steps < 3; ++steps) {
      const Reach reach{1e9, t + 0.5, 0.5, 1, false};
      const SeriesStep& made = series.stride(
          t, x.data(), {series.isNextBegunAt(t), length, length, kSmall, kSmall, 0.3, reach});
      ASSERT_EQ(made.made, 1);
      ASSERT_EQ(made.refused, 0.0);
      EXPECT_GT(made.taken, 0.0);
      EXPECT_LE(made.taken, 0.5);
      EXPECT_EQ(made.end, made.taken == 0.5 ? t + 0.5 : t + made.taken);
      x.assign(made.x_new);
      t = made.end;
      length = made.length;
      simulation_.advanceTo(t);
      const Sample& sample = simulation_.sample();
      State dxdt(system_.size());
      system_(x, dxdt, t);
      for (int i = 0; i < S; ++i) {
        const auto near = [&](double value, double expected, const char* what) {
          EXPECT_NEAR(value, expected, 1e-9 * std::max(1.0, std::abs(expected)))
              << what << " of shaft " << i << " after " << steps << " steps";
        };
        near(x[i], sample.angle[i], "angle");
        near(x[S + i], sample.velocity[i], "velocity");
        near(x[2 * S + i], sample.acceleration[i], "acceleration");
        near(made.eta[i], dxdt[2 * S + i], "jerk");
        near(made.node[0].torque[i], sample.applied_torque[i], "torque");
      }
      // On the constraints, to rounding.
      State moved(system_.size());
      std::uint64_t iterations = 0;
      EXPECT_EQ(system_.project(t, x, moved, &iterations), ProjectionResult::kConverged);
      for (int n = 0; n < x.size(); ++n) {
        EXPECT_LE(moved[n], 1e-14 * std::max(1.0, std::abs(x[n]))) << "x" << n;
      }
    }
  }
  void expectMotion(double s) {
    simulation_.advanceTo(kStart + s * unit_);
    const Sample& sample = simulation_.sample();
    ASSERT_TRUE(simulation_.status().ok()) << simulation_.describeStatus();
    for (int i = 0; i < S; ++i) {
      const auto near = [&](double value, double expected, const char* what) {
        EXPECT_NEAR(value, expected, 3e-11 * std::max(1.0, std::abs(expected)))
            << what << " of shaft " << i << " at s = " << s;
      };
      near(sum(coefficients(i), s), sample.angle[i], "angle");
      near(sum(coefficients(S + i), s), sample.velocity[i], "velocity");
      near(sum(coefficients(2 * S + i), s), sample.acceleration[i], "acceleration");
      near(sum(system_.series()->torque(i), s), sample.applied_torque[i], "torque");
    }
  }

 private:
  const Scene scene_;
  Simulation simulation_;
  System system_;
  const int S;  // shafts
  std::vector<double> x_;
  double unit_ = 1.0;
};

std::string twoShafts(const std::string& rest, const std::string& more = "") {
  return test::sceneText(
      "a 0.8, b 2",
      {"motor on a: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)", "drag on b: -0.02*w2^2-0.1*w2"},
      more + rest);
}
std::string oneConstraint(const std::string& order, const std::string& expression) {
  return "constraints: [v]\nv: {type: variator_sim/ExpressionConstraint, order: " + order +
         ", expression: \"" + expression + "\"}\n";
}
std::string heldInput(const std::string& hold) {
  return "inputs: [u]\nu: {topic: u, initial: 0.4, hold: " + hold + "}\n";
}

/// Four shafts, coupled, one of them with harmonics, and three constraints of all orders.
const std::string kFour = test::sceneText(
    "a 0.5, b, c 2, d 0.7",
    {"motor on a: 20-w1+sin(phi1)", "drag on d: -0.5*w4", "gear of order 1: w2-(0.5+0.1*sin(t))*w1",
     "slip: 0.3*(e3-0.7*e2)*(1+0.01*e3^2)+w3-0.7*w2",
     "start of order 3: j4*(2+0.1*e4)-0.3*cos(t)*e1"},
    "b: {inertia: {mean: 1, harmonics: [{order: 1, cos: 0.2}, {order: 2, cos: 0.1, sin: -0.15}]}}\n"
    "inertia_coupling: [[a, c, 0.1], [b, d, -0.2]]\n"
    "initial: {velocity: [2, 1, 0.5, 0], project: true}");

/// An inertia that depends on the angle, orders 1 and 2.
const std::string kHarmonics = test::sceneText(
    "a, b 0.6, c 2",
    {"motor on a: 20-w1+sin(phi1)", "drag on c: -0.5*w3", "gear of order 1: w2-(0.5+0.1*sin(t))*w1",
     "slip: 0.3*(e3-0.7*e2)*(1+0.01*e3^2)+w3-0.7*w2"},
    "a: {inertia: {mean: 1, harmonics: [{order: 1, cos: 0.2}, {order: 2, cos: 0.1, sin: -0.15}]}}\n"
    "initial: {velocity: [2, 1, 0.5], project: true}");

std::vector<Case> makeCases() {
  const std::string start = "initial: {velocity: [5, 3], acceleration: [4, 2.75], project: true}\n";
  const std::string least = "principle: gauss\ninitial: {velocity: [5, 3], project: true}\n";
  const std::string order1 = oneConstraint("1", "w2-(0.6+0.1*sin(0.7*t)+0.01*tanh(phi1))*w1");
  const std::string order2 =
      oneConstraint("2", "e2-(0.6+0.1*sin(0.7*t))*e1-0.07*cos(0.7*t)*w1+0.1*(w2-0.6*w1)");
  const std::string curved = oneConstraint(
      "2", "0.2*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2))+w2-(0.6+0.2*sin(0.7*t))*w1");
  const std::string order3 = oneConstraint("3", "j2*(1+0.1*e1)-0.6*j1*cosh(0.1*w2)-0.1*cos(0.7*t)");
  const std::string coupled = "inertia_coupling: [[a, b, 0.3]]\n";
  std::vector<Case> cases = {
      {"free", twoShafts("initial: {velocity: [5, 3]}\n")},
      {"free_least", twoShafts("principle: gauss\ninitial: {velocity: [5, 3]}\n")},
      {"order_1", twoShafts(order1 + start)},
      {"order_1_least", twoShafts(order1 + least, coupled)},
      {"order_2", twoShafts(order2 + start, coupled)},
      {"order_2_least", twoShafts(order2 + least)},
      {"curved", twoShafts(curved + start, coupled)},
      {"curved_least", twoShafts(curved + least, coupled)},
      {"harmonics", kHarmonics},
      {"order_3", twoShafts(order3 + start, coupled)},
      {"four", kFour},
      {"circle",
       twoShafts(oneConstraint("2", "e1^2+e2^2-4") + "initial: {acceleration: [1.2, 1.6]}\n")},
      {"crank",
       test::sceneText(
           "a, b 2", {},
           "a: {inertia: {mean: 1, harmonics: [{order: 1, cos: 0.15}, {order: 2, cos: 0.05, sin: "
           "0.02}]}}\ninitial: {velocity: [5, 3], project: true}\n" +
               std::string("inertia_coupling: [[a, b, 0.3]]\ntorques: [motor]\nmotor: {type: "
                           "variator_sim/ExpressionTorque, shaft: a, torque: \"5-0.3*w1\"}\n") +
               order1)},
  };
  cases.push_back({"crank_least", cases.back().text + "principle: gauss\n"});
  // Inputs of every hold, in a torque and in constraints, where their rates count.
  for (const char* hold :
       {"zero_order", "first_order_lag, time_constant: 0.8", "rate_limit, rate: 0.6",
        "first_order_hold, period: 2", "second_order_lag, time_constant: 0.7"}) {
    const std::string name = "input_" + std::string(hold).substr(0, std::string(hold).find(','));
    const std::string lagged = "0.2*(e2-u*e1)+w2-u*w1+0.01*e1^3";
    cases.push_back({name, heldInput(hold) + twoShafts(oneConstraint("2", lagged) + start)});
    cases.push_back(
        {name + "_least", heldInput(hold) + twoShafts(oneConstraint("2", lagged) + least)});
    if (std::string(hold).find("second") == 0) {
      cases.push_back(
          {name + "_1", heldInput(hold) + twoShafts(oneConstraint("1", "w2-u*w1") + start)});
      cases.push_back(
          {name + "_1_least", heldInput(hold) + twoShafts(oneConstraint("1", "w2-u*w1") + least)});
    }
  }
  return cases;
}

class OfScene : public ::testing::TestWithParam<Case> {};

TEST_P(OfScene, SatisfiesTheEquations) {
  Expansion expansion(test::sceneFromText(GetParam().text));
  ASSERT_TRUE(expansion.expand(0.25, kOrder));
  const double reach = expansion.reach();
  EXPECT_GT(reach, 0.02);
  for (const double part : {0.0, 0.25, 0.5, 1.0}) {
    expansion.expectEquations(part * reach);
    expansion.expectMotion(part * reach);
  }
}

TEST_P(OfScene, MakesWholeStepsAlongTheMotion) {
  Expansion expansion(test::sceneFromText(GetParam().text));
  const std::string& name = GetParam().name;
  // Generalized Gauss, one order or orders 1 and 2, inertias that are constant or not coupled.
  const bool is_least = name.find("least") != std::string::npos;
  const bool moves = name.rfind("input_", 0) == 0 && name != "input_zero_order";
  ASSERT_EQ(expansion.makesWholeSteps(), !is_least && !moves && name != "four" && name != "crank");
  if (expansion.makesWholeSteps()) expansion.expectWholeSteps();
}

// In another unit of time it is the same polynomial.
TEST_P(OfScene, IsTheSameInEveryUnit) {
  Expansion expansion(test::sceneFromText(GetParam().text));
  const int size = 6;
  ASSERT_TRUE(expansion.expand(1.0, kOrder));
  std::vector<std::vector<double>> first;
  for (int n = 0; n < size; ++n) {
    first.emplace_back(expansion.coefficients(n), expansion.coefficients(n) + kOrder + 1);
  }
  ASSERT_TRUE(expansion.expand(0.125, kOrder));
  for (int n = 0; n < size; ++n) {
    for (int k = 0; k <= kOrder; ++k) {
      const double expected =
          std::ldexp(first[static_cast<std::size_t>(n)][static_cast<std::size_t>(k)], -3 * k);
      EXPECT_NEAR(expansion.coefficients(n)[k], expected, 1e-12 * std::abs(expected) + 1e-300)
          << "x" << n << ", order " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(MotionSeries, OfScene, ::testing::ValuesIn(makeCases()),
                         [](const auto& tested) { return tested.param.name; });

TEST(MotionSeries, AreNoneOfOrder3UnderGauss) {
  Expansion expansion(test::sceneFromText(
      twoShafts(oneConstraint("3", "j2-0.6*j1") +
                "principle: gauss\ninitial: {velocity: [5, 3], project: true}\n")));
  EXPECT_FALSE(expansion.expand(0.25, 1));
}

// A function's values at the last step's end do not predict the next step's beginning after a
// command has moved an input: exp(-(w - u)^2) is as large at w = 1.4 for u = 0.4 as at w = 101 for
// u = 100, and on the way there it comes from exp(-9801).
TEST(MotionSeries, MayHideSomethingBehindACommand) {
  const Scene scene = test::sceneFromText(heldInput("zero_order") +
                                          test::sceneText("a 1", {"bump on a: exp(-(w1-u)^2)"}));
  System system(scene);
  system.drivetrain().resetInputs();
  MotionSeries& series = *system.formulas();
  const double slow[] = {0.0, 1.4, 0.0};
  const double fast[] = {0.0, 101.0, 0.0};
  EXPECT_FALSE(series.mayHideAlong(0.0, 0.1, slow, slow));
  system.drivetrain().signal(0).command(scene.inputs[0], 0.1, 100.0);
  EXPECT_TRUE(series.mayHideAlong(0.1, 0.1, slow, fast));
}

}  // namespace
}  // namespace variator_sim
