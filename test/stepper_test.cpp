// Each stepper's empirical order, its error estimate, the refusal of NaN and the bounds on steps.
#include "stepper.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "generalized_gauss.h"
#include "step_control.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

using State = GeneralizedGauss<2>::State;

const char* const kShip = R"yaml(
shafts: [drive, load]
drive: {inertia: 0.8}
load: {inertia: 2.0}
torques: [motor, propeller]
motor: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "12*((50-w1)/50)/(((50-w1)/50)^2+0.04)"}
propeller: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.02*w2^2"}
constraints: [variator]
variator:
  type: variator_sim/ExpressionConstraint
  order: 2
  expression: "0.2*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2)) + w2-(0.6+0.2*sin(0.7*t))*w1"
initial: {velocity: [5.0, 2.0]}
)yaml";

/// The ship scene's state at 0.
State initialState(const Scene& scene) {
  Simulation simulation(scene);
  const Sample& sample = simulation.sample();
  State x;
  for (std::size_t i = 0; i < 2; ++i) {
    x[i] = sample.angle[i];
    x[2 + i] = sample.velocity[i];
    x[4 + i] = sample.acceleration[i];
  }
  return x;
}

struct Result {
  State x;
  double worst_estimate = 0.0;
};

constexpr double kEnd = 4.0;

/// Equal steps to kEnd, no projection.
Result integrate(const Scene& scene, StepperKind kind, int steps) {
  GeneralizedGauss<2> drivetrain(scene);
  SolverSettings settings;
  settings.stepper = kind;
  const auto stepper = makeStepper<State, GeneralizedGauss<2>>(settings);
  Result result;
  result.x = initialState(scene);
  for (int n = 0; n < steps; ++n) {
    const double t = kEnd * n / steps;
    State dxdt;
    State next;
    State dxdt_next;
    State error;
    drivetrain(result.x, dxdt, t);
    stepper->step(drivetrain, result.x, dxdt, t, kEnd / steps, next, dxdt_next, error);
    for (double value : error) {
      result.worst_estimate = std::max(result.worst_estimate, std::abs(value));
    }
    result.x = next;
  }
  return result;
}

double distance(const State& a, const State& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

/// Halves the step until round-off and fits the slope of log error over log step.
void expectOrder(StepperKind kind, int first_steps, double order) {
  const Scene scene = test::sceneFromText(kShip);
  const State exact = integrate(scene, StepperKind::kFehlberg78, 1024).x;
  std::vector<double> errors;
  for (int steps = first_steps; steps <= 4096; steps *= 2) {
    const double error = distance(integrate(scene, kind, steps).x, exact);
    if (error < 1e-12) break;
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

// The estimated local error falls with h^errorOrder.
TEST(StepperErrorEstimate, HasTheOrderThatStepControlAssumes) {
  const Scene scene = test::sceneFromText(kShip);
  for (StepperKind kind : {StepperKind::kDopri5, StepperKind::kFehlberg78}) {
    SolverSettings settings;
    settings.stepper = kind;
    const int order = makeStepper<State, GeneralizedGauss<2>>(settings)->errorOrder();
    const int steps = kind == StepperKind::kDopri5 ? 256 : 48;
    const double coarse = integrate(scene, kind, steps).worst_estimate;
    const double fine = integrate(scene, kind, 2 * steps).worst_estimate;
    EXPECT_NEAR(std::log2(coarse / fine), order, 0.6) << toString(kind);
  }
}

// Dense output inside one step converges with the order of the error estimate.
TEST(DenseOutput, Dopri5HasOrder5InOneStep) {
  const Scene scene = test::sceneFromText(kShip);
  const State start = initialState(scene);
  std::vector<double> errors;
  for (double h : {0.04, 0.02, 0.01}) {
    GeneralizedGauss<2> drivetrain(scene);
    Dopri5Stepper<State, GeneralizedGauss<2>> dopri5;
    Fehlberg78Stepper<State, GeneralizedGauss<2>> fehlberg78;
    State dxdt;
    State next;
    State dxdt_next;
    State error;
    drivetrain(start, dxdt, 0.0);
    dopri5.step(drivetrain, start, dxdt, 0.0, h, next, dxdt_next, error);
    double worst = 0.0;
    for (double part : {0.2, 0.5, 0.8}) {
      State inside;
      State exact;
      State unused;
      dopri5.interpolate(part * h, start, dxdt, 0.0, dxdt_next, h, inside);
      fehlberg78.step(drivetrain, start, dxdt, 0.0, part * h, exact, unused, error);
      worst = std::max(worst, distance(inside, exact));
    }
    errors.push_back(worst);
  }
  EXPECT_NEAR(std::log2(errors[1] / errors[2]), 5.0, 0.5);
}

TEST(ErrorNorm, IsNanWhenAnythingIsNotFinite) {
  const std::array<double, 3> fine{1.0, 2.0, 3.0};
  const std::array<double, 3> small{1e-12, 1e-12, 1e-12};
  EXPECT_LT(calcErrorNorm(small, fine, fine, 1e-9, 1e-9), 1.0);
  for (double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    for (std::size_t i = 0; i < 3; ++i) {
      std::array<double, 3> poisoned = fine;
      poisoned[i] = bad;
      EXPECT_TRUE(std::isnan(calcErrorNorm(small, fine, poisoned, 1e-9, 1e-9)));
      std::array<double, 3> error = small;
      error[i] = bad;
      EXPECT_FALSE(calcErrorNorm(error, fine, fine, 1e-9, 1e-9) <= 1.0);
    }
  }
}

TEST(ErrorNorm, IsTheLargestErrorOverItsAllowance) {
  const std::array<double, 2> x{0.0, 100.0};
  const std::array<double, 2> error{2e-6, 1e-4};
  // allowances 1e-6 and 1e-6 + 1e-6 * 100
  EXPECT_NEAR(calcErrorNorm(error, x, x, 1e-6, 1e-6), 2.0, 1e-12);
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
