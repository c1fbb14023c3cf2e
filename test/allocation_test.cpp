// After set-up the running loop allocates nothing: steps, commands, jumps, samples, stops, resets.

#include "support/count_allocations.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

const std::string kScene =
    test::sceneText("drive 0.5, middle 0.3, load 1.2",
                    {"engine on drive from drive_torque, hold: zero_order",
                     "brake on load from load_torque, hold: first_order_lag, time_constant: 0.05",
                     "throttle on middle from throttle, hold: rate_limit, rate: 3",
                     "friction on load: -0.3*w3-0.1*tanh(w2)",
                     "variator: 0.5*(e3-0.8*e1)+0.01*(e1^2+e1*e3)+w3-0.8*w1", "gear: e2-0.5*e1"},
                    "inertia_coupling: [[drive, middle, 0.05]]\n"
                    "initial: {velocity: [10, 5, 8]}");

TEST(Allocation, CounterCounts) {
#ifndef VARIATOR_SIM_COUNTS_ALLOCATIONS
  GTEST_SKIP() << "under a sanitizer";
#endif
  const long before = allocations;
  // The string is longer than any small-string buffer.
  const std::string text(1000, 'x');
  EXPECT_GT(allocations, before) << text.size();
}

class Allocation : public testing::TestWithParam<StepperKind> {};

TEST_P(Allocation, NoneInTheRunningLoop) {
  Simulation simulation(test::withStepper(test::sceneFromText(kScene), GetParam()));
  const long before = allocations;
  double sum = 0.0;
  for (int round = 0; round < 2; ++round) {
    simulation.command(0, 2.0);  // before the first instant: new initial accelerations
    for (int n = 1; n <= 400; ++n) {
      simulation.advanceTo(n / 200.0);
      if (n % 20 == 0) {
        simulation.command(0, 10.0 * std::sin(0.1 * n));  // jumps, nonlinear
        simulation.command(1, n);
        simulation.command(2, -0.01 * n);
      }
      if (n % 50 == 1) simulation.command(0, std::nan(""));
      sum += simulation.sample().acceleration[0];
    }
    simulation.reset();
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(std::isfinite(sum));
}

TEST(Allocation, NoneEstimatingErrors) {
  Simulation simulation(test::sceneFromText(kScene));
  simulation.estimateErrors(true);
  const long before = allocations;
  double sum = 0.0;
  for (int round = 0; round < 2; ++round) {
    for (int n = 1; n <= 200; ++n) {
      simulation.advanceTo(n / 200.0);
      if (n % 20 == 0) simulation.command(0, 10.0 * std::sin(0.1 * n));
      sum += simulation.sample().velocity_error[0] + simulation.errorDoubt().grown;
    }
    simulation.reset();
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(std::isfinite(sum));
}

TEST(Allocation, NoneAskingForQuantities) {
  Simulation simulation(test::sceneFromText(std::string(kScene) + R"yaml(
outputs: [ratio, nothing]
ratio: {expression: "w3/w1 + tanh(e2)"}
nothing: {expression: "log(-1 - w1^2)"}
)yaml"));
  std::vector<double> values(100);
  const long before = allocations;
  for (int n = 1; n <= 200; ++n) {
    simulation.advanceTo(n / 200.0);
    if (n % 20 == 0) simulation.command(0, 10.0 * std::sin(0.1 * n));
    for (const QuantityGroup group : kQuantityGroups) {
      simulation.calcQuantities(group, values.data());
    }
  }
  EXPECT_EQ(allocations - before, 0);
  simulation.calcQuantities(QuantityGroup::kOutputs, values.data());
  EXPECT_TRUE(std::isnan(values[1]));
}

TEST(Allocation, NoneSavingStates) {
  Simulation simulation(test::sceneFromText(kScene));
  MotionState state;
  const long before = allocations;
  for (int n = 1; n <= 20; ++n) {
    simulation.advanceTo(n / 20.0);
    EXPECT_TRUE(simulation.saveState(&state));
  }
  EXPECT_EQ(allocations - before, 0);
}

/// All principles and orders, nonlinear, with an inertia that depends on the angle.
TEST(Allocation, NoneUnderAnyPrinciple) {
  for (const std::string principle : {"generalized_gauss", "gauss"}) {
    for (const std::string last : {"order: 2, expression: \"e3-0.5*e2+0.01*e3^2+w3-0.5*w2\"",
                                   "order: 3, expression: \"j3-0.5*j2+0.01*e3*j3+e3-0.5*e2\""}) {
      Simulation simulation(test::sceneFromText(
          "crank, middle 0.3, load 1.2",
          {"engine on crank from drive_torque, hold: zero_order", "friction on load: -0.3*w3",
           "belt of order 1: w2-(0.8+0.1*sin(t))*w1",
           std::string("last = ExpressionConstraint, ") + last},
          std::string("crank: {inertia: {mean: 0.5, harmonics: [{order: 2, cos: 0.1}]}}\ninitial: "
                      "{velocity: [10, 8, 4], project: true}\nprinciple: ") +
              principle));
      const long before = allocations;
      for (int n = 1; n <= 200; ++n) {
        simulation.advanceTo(n / 200.0);
        if (n % 20 == 0) simulation.command(0, std::sin(0.1 * n));
        simulation.sample();
      }
      EXPECT_EQ(allocations - before, 0) << principle << ", " << last;
      EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Steppers, Allocation,
                         testing::Values(StepperKind::kAuto, StepperKind::kRk4,
                                         StepperKind::kDopri5, StepperKind::kFehlberg78,
                                         StepperKind::kRadau, StepperKind::kTaylor,
                                         StepperKind::kTaylorFixed),
                         [](const auto& test) { return std::string(toString(test.param)); });

TEST(Allocation, NoneWhenAMotionStops) {
  Simulation simulation(
      test::sceneFromText("drive 1", {"motor on drive: w1^2"}, "initial: {velocity: [1]}"));
  const long before = allocations;
  simulation.advanceTo(2.0);
  EXPECT_EQ(allocations - before, 0);
  EXPECT_FALSE(simulation.status().ok());
}

/// Stiff through its slip time constant; `last` are more lines.
Scene stiffScene(const std::string& last = "") {
  return test::withTolerance(
      test::sceneFromText(
          test::sceneText(
              "drive 0.8, load 2",
              {"motor on drive from torque, hold: zero_order",
               "friction on load: -0.3*w2-0.1*tanh(w1)",
               "variator: 1e-5*(e2-(0.6+0.2*sin(0.7*t))*e1)+w2-(0.6+0.2*sin(0.7*t))*w1"},
              "initial: {velocity: [5, 3]}") +
          last),
      1e-6);
}

// The change from the explicit to the implicit stepper included.
TEST(Allocation, NoneOnAStiffScene) {
  for (StepperKind stepper : {StepperKind::kAuto, StepperKind::kRadau}) {
    Simulation simulation(test::withStepper(stiffScene(), stepper));
    const long before = allocations;
    double sum = 0.0;
    for (int round = 0; round < 2; ++round) {
      for (int n = 1; n <= 200; ++n) {
        simulation.advanceTo(n / 100.0);
        if (n % 50 == 0) simulation.command(0, 0.1 * n);
        sum += simulation.sample().acceleration[0];
        sum += static_cast<double>(simulation.statistics().implicit_steps);
      }
      if (round == 0) simulation.reset();
    }
    EXPECT_EQ(allocations - before, 0) << toString(stepper);
    EXPECT_TRUE(std::isfinite(sum));
    EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
    EXPECT_GT(simulation.statistics().implicit_steps, 0u);
    if (stepper == StepperKind::kAuto) {
      EXPECT_GE(simulation.statistics().stepper_switches, 1u);
    }
  }
}

// Implicit steps under the other principle, whose linearization is made of differences, and with
// more than one constraint and a full inertia.
TEST(Allocation, NoneInImplicitStepsOfAnyScene) {
  const Scene scenes[] = {stiffScene("principle: gauss\n"), test::sceneFromText(kScene)};
  for (const Scene& scene : scenes) {
    Simulation simulation(test::withStepper(test::withTolerance(scene, 1e-5), StepperKind::kRadau));
    simulation.command(0, 2.0);
    const long before = allocations;
    for (int n = 1; n <= 20; ++n) {
      simulation.advanceTo(n / 20.0);
      simulation.sample();
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  }
}

TEST(Allocation, NoneFallingAsleepAndWaking) {
  Simulation simulation(test::sceneFromText(
      "drive 0.8, load 2", {"motor on drive from torque, hold: zero_order",
                            "friction on drive: -0.5*w1", "variator: 0.2*(e2-0.6*e1)+w2-0.6*w1"}));
  const long before = allocations;
  double sum = 0.0;
  bool slept = true;
  for (int round = 1; round <= 3; ++round) {
    simulation.command(0, round);
    simulation.advanceTo(500.0 * round - 250.0);
    slept = slept && simulation.isSleeping();
    sum += simulation.sample().angle[0];
    simulation.advanceTo(500.0 * round);
    sum += simulation.sample().angle[0];
  }
  const std::uint64_t sleeps = simulation.statistics().sleeps;
  simulation.reset();
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(slept);
  EXPECT_GE(sleeps, 3u);
  EXPECT_TRUE(std::isfinite(sum));
}

TEST(Allocation, NoneSamplingInsideStepsOfHighOrder) {
  Simulation simulation(test::withStepper(test::sceneFromText(kScene), StepperKind::kFehlberg78));
  simulation.command(0, 2.0);
  const long before = allocations;
  double sum = 0.0;
  for (int n = 1; n <= 2000; ++n) {
    simulation.advanceTo(n / 1000.0);
    sum += simulation.sample().acceleration[0];
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(std::isfinite(sum));
  EXPECT_LT(simulation.statistics().steps, 1000u);  // most samples were inside steps
}

}  // namespace
}  // namespace variator_sim
