// Each stepper's empirical order, its error estimate, the refusal of NaN and the bounds on steps.
#include "integrate/stepper.h"

#include <complex>

#include "dynamics/system.h"
#include "integrate/radau_method.h"
#include "integrate/step_control.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr int kSize = 6;

/// Error estimates are told in units of this: absolute only.
constexpr Tolerance kUnit{1e-10, 0.0};

const std::string kShip = test::sceneText(
    "drive 0.8, load 2",
    {"motor on drive: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)", "propeller on load: -0.02*w2^2",
     "variator: 0.2*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2)) + "
     "w2-(0.6+0.2*sin(0.7*t))*w1"},
    "initial: {velocity: [5, 2]}");

/// The ship scene's state at 0.
State initialState(const Scene& scene) {
  Simulation simulation(scene);
  const Sample& sample = simulation.sample();
  State x(kSize);
  for (int i = 0; i < 2; ++i) {
    x[i] = sample.angle[i];
    x[2 + i] = sample.velocity[i];
    x[4 + i] = sample.acceleration[i];
  }
  return x;
}

struct Result {
  State x{State(kSize)};
  double worst_estimate = 0.0;
};

constexpr double kEnd = 4.0;

/// Radau with three stages, as every other number of them has too small errors to see.
std::unique_ptr<Stepper> make(StepperKind kind, const System& system) {
  return kind == StepperKind::kRadau ? makeRadauStepper(system, kUnit, 3)
                                     : makeStepper(kind, system, kUnit);
}

/// Equal steps to kEnd, no projection.
Result integrate(const Scene& scene, StepperKind kind, int steps) {
  System drivetrain(scene);
  const auto stepper = make(kind, drivetrain);
  Result result;
  result.x = initialState(scene);
  for (int n = 0; n < steps; ++n) {
    StepNode from(kEnd * n / steps, result.x, State(kSize));
    drivetrain(from.x, from.dxdt, from.time);
    const double error = stepper->step(drivetrain, from, kEnd / steps, result.x);
    result.worst_estimate = std::max(result.worst_estimate, error);
  }
  return result;
}

double distance(const State& a, const State& b) {
  double largest = 0.0;
  for (int i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

/// Halves the step until round-off and fits the slope of log error over log step.
void expectOrder(StepperKind kind, int first_steps, double order, double floor = 1e-12) {
  const Scene scene = test::sceneFromText(kShip);
  const State exact = integrate(scene, StepperKind::kFehlberg78, 1024).x;
  std::vector<double> errors;
  for (int steps = first_steps; steps <= 4096; steps *= 2) {
    const double error = distance(integrate(scene, kind, steps).x, exact);
    if (error < floor) break;
    errors.push_back(error);
  }
  ASSERT_GE(errors.size(), 3u) << "too few steps above round-off to see an order";
  const double measured = std::log2(errors[errors.size() - 2] / errors.back());
  EXPECT_GT(measured, order - 0.35);
  EXPECT_LT(measured, order + 1.0);
}

TEST(StepperOrder, Rk4) {
  expectOrder(StepperKind::kRk4, 64, 4.0);
}
TEST(StepperOrder, Dopri5) {
  expectOrder(StepperKind::kDopri5, 32, 5.0);
}
TEST(StepperOrder, Fehlberg78) {
  expectOrder(StepperKind::kFehlberg78, 12, 8.0);
}
TEST(StepperOrder, RadauOfThreeStages) {
  expectOrder(StepperKind::kRadau, 8, 5.0, 1e-9);
}

/// The error of a step of order 13 shows only against a closed form whose Newton iteration
/// converges at once: w = sin(3 t) + exp(-t).
const std::string kLinear = test::sceneText("a 1", {"q on a: sin(3*t)+3*cos(3*t)-w1"},
                                            "initial: {velocity: [1], acceleration: [2]}");
State linearMotion(double t) {
  State x(3);
  x[0] = (1.0 - std::cos(3.0 * t)) / 3.0 + 1.0 - std::exp(-t);
  x[1] = std::sin(3.0 * t) + std::exp(-t);
  x[2] = 3.0 * std::cos(3.0 * t) - std::exp(-t);
  return x;
}

struct RadauErrors {
  double at_end = 0.0;
  double inside = 0.0;  // of the first step
};
RadauErrors followLinearMotion(int stages, int steps) {
  const Scene scene = test::sceneFromText(kLinear);
  System drivetrain(scene);
  const auto stepper = makeRadauStepper(drivetrain, {1e-13, 0.0}, stages);
  const double h = kEnd / steps;
  RadauErrors errors;
  StepNode to(0.0, linearMotion(0.0), State(3));
  for (int n = 0; n < steps; ++n) {
    StepNode from(n * h, to.x, State(3));
    drivetrain(from.x, from.dxdt, from.time);
    EXPECT_TRUE(std::isfinite(stepper->step(drivetrain, from, h, to.x)));
    EXPECT_EQ(stepper->errorOrder(), stages + 1);
    to.time = from.time + h;
    for (double part : {0.1, 0.3, 0.5, 0.7, 0.9}) {
      if (n > 0) break;
      State x(3);
      EXPECT_TRUE(stepper->interpolate(drivetrain, part * h, from, to, x));
      errors.inside = std::max(errors.inside, distance(x, linearMotion(part * h)));
    }
  }
  errors.at_end = distance(to.x, linearMotion(kEnd));
  return errors;
}

TEST(StepperOrder, RadauOfAnyNumberOfStages) {
  struct Case {
    int stages;
    int steps;
  };
  for (const Case& c : {Case{3, 64}, Case{5, 10}, Case{7, 3}}) {
    const RadauErrors coarse = followLinearMotion(c.stages, c.steps);
    const RadauErrors fine = followLinearMotion(c.stages, 2 * c.steps);
    const double order = std::log2(coarse.at_end / fine.at_end);
    EXPECT_GT(order, 2 * c.stages - 1.35) << c.stages;
    EXPECT_LT(order, 2 * c.stages) << c.stages;
    EXPECT_NEAR(std::log2(coarse.inside / fine.inside), c.stages + 1, 0.6) << c.stages;
  }
}

// A step that is much too long for Newton's iteration is tried again with two stages less; steps
// that it has no trouble with bring them back.
TEST(Radau, HasFewerStagesWhereNewtonsIterationFails) {
  const Scene scene = test::sceneFromText(kShip);
  System drivetrain(scene);
  const auto stepper = makeRadauStepper(drivetrain, kUnit, 7);
  StepNode node(0.0, initialState(scene), State(kSize));
  State x(kSize);
  drivetrain(node.x, node.dxdt, node.time);
  EXPECT_TRUE(std::isnan(stepper->step(drivetrain, node, 2.0, x)));
  EXPECT_EQ(stepper->errorOrder(), 8);
  EXPECT_TRUE(std::isnan(stepper->step(drivetrain, node, 1.0, x)));
  EXPECT_EQ(stepper->errorOrder(), 6);
  constexpr double kShort = 1e-3;
  for (int n = 0; n < 6; ++n) {
    EXPECT_TRUE(std::isfinite(stepper->step(drivetrain, node, kShort, x)));
    EXPECT_EQ(stepper->errorOrder(), n < 5 ? 4 : 6) << n;
    node = StepNode(node.time + kShort, x, State(kSize));
    drivetrain(node.x, node.dxdt, node.time);
  }
  stepper->restart();
  EXPECT_EQ(stepper->errorOrder(), 8);  // as at the start of every run
  EXPECT_TRUE(std::isfinite(stepper->step(drivetrain, node, kShort, x)));
  EXPECT_EQ(stepper->errorOrder(), 8);
}

// A Radau IIA method is known by its order conditions: B(2s - 1) and C(s) (Hairer, Wanner: Solving
// ODE II, IV.5), and by where its stages lie, the last one at the end.
TEST(RadauMethod, MeetsTheOrderConditions) {
  for (const int stages : {3, 5, 7}) {
    const RadauMethod& method = RadauMethod::withStages(stages);
    const auto s = static_cast<std::size_t>(stages);
    ASSERT_EQ(method.stages(), stages);
    EXPECT_EQ(method.points()[s - 1], 1.0);
    for (std::size_t i = 0; i < s; ++i) {
      // the last row is the weights
      const int order = i == s - 1 ? 2 * stages - 1 : stages;
      for (int k = 1; k <= order; ++k) {
        double sum = 0.0;
        for (std::size_t j = 0; j < s; ++j) {
          sum += method.coefficients()[i][j] * std::pow(method.points()[j], k - 1);
        }
        EXPECT_NEAR(sum, std::pow(method.points()[i], k) / k, 1e-15) << stages << ", " << k;
      }
    }
  }
}

// T^-1 A^-1 T, and the weights of its polynomial.
TEST(RadauMethod, TakesItsStagesApart) {
  for (const int stages : {3, 5, 7}) {
    const RadauMethod& method = RadauMethod::withStages(stages);
    const auto s = static_cast<std::size_t>(stages);
    const auto expected = [&](std::size_t a, std::size_t b) {
      if (a == 0 || b == 0) return a == b ? method.real() : 0.0;
      if ((a - 1) / 2 != (b - 1) / 2) return 0.0;
      const std::complex<double> value = method.pair(static_cast<int>((a - 1) / 2));
      return a == b ? value.real() : a < b ? -value.imag() : value.imag();
    };
    for (std::size_t a = 0; a < s; ++a) {
      for (std::size_t b = 0; b < s; ++b) {
        double block = 0.0;
        double unit = 0.0;
        for (std::size_t i = 0; i < s; ++i) {
          unit += method.coefficients()[a][i] * method.inverse()[i][b];
          for (std::size_t j = 0; j < s; ++j) {
            block +=
                method.inverseTransform()[a][i] * method.inverse()[i][j] * method.transform()[j][b];
          }
        }
        EXPECT_NEAR(block, expected(a, b), 1e-12) << stages;
        EXPECT_NEAR(unit, a == b ? 1.0 : 0.0, 1e-13) << stages;
      }
    }
  }
  // Three stages have closed forms.
  const double root = std::sqrt(6.0);
  const RadauMethod& method = RadauMethod::withStages(3);
  EXPECT_NEAR(method.points()[0], (4.0 - root) / 10.0, 1e-16);
  EXPECT_NEAR(method.points()[1], (4.0 + root) / 10.0, 1e-16);
  EXPECT_NEAR(method.real(), 3.0 + std::cbrt(3.0) * (std::cbrt(3.0) - 1.0), 1e-15);
  RadauMethod::Vector weights{};
  method.calcSlopeWeights(0.0, weights);
  EXPECT_NEAR(weights[0], (13.0 + 7.0 * root) / 3.0, 1e-14);
  EXPECT_NEAR(weights[1], (13.0 - 7.0 * root) / 3.0, 1e-14);
  EXPECT_NEAR(weights[2], 1.0 / 3.0, 1e-15);
}

// The weights have to reproduce a polynomial of degree s, inside the step and beyond.
TEST(RadauMethod, WeighsItsStagesAsAPolynomialDoes) {
  for (const int stages : {3, 5, 7}) {
    const RadauMethod& method = RadauMethod::withStages(stages);
    for (const double theta : {0.0, 0.3, 1.0, 1.7}) {
      RadauMethod::Vector values{};
      RadauMethod::Vector slopes{};
      method.calcValueWeights(theta, values);
      method.calcSlopeWeights(theta, slopes);
      double value = 0.0;
      double slope = 0.0;
      for (std::size_t i = 0; i < static_cast<std::size_t>(stages); ++i) {
        value += values[i] * std::pow(method.points()[i], stages);
        slope += slopes[i] * std::pow(method.points()[i], stages);
      }
      EXPECT_NEAR(value, std::pow(theta, stages), 1e-11);
      EXPECT_NEAR(slope, stages * std::pow(theta, stages - 1), 1e-10);
    }
  }
}

// The estimated local error falls with h^errorOrder.
TEST(StepperErrorEstimate, HasTheOrderThatStepControlAssumes) {
  const Scene scene = test::sceneFromText(kShip);
  const System drivetrain(scene);
  for (StepperKind kind : {StepperKind::kDopri5, StepperKind::kFehlberg78, StepperKind::kRadau}) {
    const int order = make(kind, drivetrain)->errorOrder();
    const int steps = order == 8 ? 48 : 256;
    const double coarse = integrate(scene, kind, steps).worst_estimate;
    const double fine = integrate(scene, kind, 2 * steps).worst_estimate;
    EXPECT_NEAR(std::log2(coarse / fine), order, 0.7) << toString(kind);
  }
}

/// Largest error of the dense output inside one step of size h from the start.
double worstInside(StepperKind kind, double h) {
  const Scene scene = test::sceneFromText(kShip);
  System drivetrain(scene);
  const auto stepper = make(kind, drivetrain);
  const auto exact = makeStepper(StepperKind::kFehlberg78, drivetrain, kUnit);
  StepNode from(0.0, initialState(scene), State(kSize));
  drivetrain(from.x, from.dxdt, 0.0);
  StepNode to(h, State(kSize), State(kSize));
  stepper->step(drivetrain, from, h, to.x);
  drivetrain(to.x, to.dxdt, h);
  double worst = 0.0;
  for (double part : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    State inside(kSize);
    State reference(kSize);
    EXPECT_TRUE(stepper->interpolate(drivetrain, part * h, from, to, inside));
    // eight short steps of order 8
    StepNode node = from;
    for (int n = 1; n <= 8; ++n) {
      exact->step(drivetrain, node, part * h / 8, reference);
      node.time = part * h * n / 8;
      node.x = reference;
      drivetrain(node.x, node.dxdt, node.time);
    }
    worst = std::max(worst, distance(inside, reference));
  }
  return worst;
}

// Dense output inside one step converges at least with the order of the error estimate.
TEST(DenseOutput, HasTheOrderOfTheErrorEstimate) {
  EXPECT_NEAR(
      std::log2(worstInside(StepperKind::kDopri5, 0.02) / worstInside(StepperKind::kDopri5, 0.01)),
      5.0, 0.5);
  EXPECT_NEAR(
      std::log2(worstInside(StepperKind::kRadau, 0.02) / worstInside(StepperKind::kRadau, 0.01)),
      4.0, 0.5);
}

State stateOf(const std::vector<double>& values) {
  State x(static_cast<int>(values.size()));
  std::copy(values.begin(), values.end(), x.begin());
  return x;
}

TEST(ErrorNorm, IsNanWhenAnythingIsNotFinite) {
  const State fine = stateOf({1.0, 2.0, 3.0});
  const State small = stateOf({1e-12, 1e-12, 1e-12});
  EXPECT_LT(calcErrorNorm(small, fine, fine, {1e-9, 1e-9}), 1.0);
  for (double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    for (int i = 0; i < 3; ++i) {
      State poisoned = fine;
      poisoned[i] = bad;
      EXPECT_TRUE(std::isnan(calcErrorNorm(small, fine, poisoned, {1e-9, 1e-9})));
      State error = small;
      error[i] = bad;
      EXPECT_FALSE(calcErrorNorm(error, fine, fine, {1e-9, 1e-9}) <= 1.0);
    }
  }
}

TEST(ErrorNorm, IsTheLargestErrorOverItsAllowance) {
  const State x = stateOf({0.0, 100.0});
  const State error = stateOf({2e-6, 1e-4});
  // allowances 1e-6 and 1e-6 + 1e-6 * 100
  EXPECT_NEAR(calcErrorNorm(error, x, x, {1e-6, 1e-6}), 2.0, 1e-12);
}

TEST(StepControl, GrowsAndShrinksWithinBounds) {
  StepControl control(5);
  EXPECT_EQ(control.growth(0.0), 5.0);
  control.reset();
  EXPECT_LT(control.growth(1.0), 1.0);
  EXPECT_GE(control.shrink(1e300), 0.2);
  EXPECT_LT(control.shrink(1.0001), 1.0);
  EXPECT_EQ(control.shrink(std::nan("")), 0.25);
}

}  // namespace
}  // namespace variator_sim
