// Stiff constraints, psi = tau (eps2 - u eps1) + omega2 - u omega1 with tau down to 1e-8 s: `auto`
// finds them by itself and takes few steps. (test/stress/stiff_test.cpp has closed forms.)

#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::plainly;

constexpr double kEnd = 3.0;

/// A motor drives a propeller through a variator that slips with the time constant tau.
Scene slipScene(double tau, const std::string& ratio = "(0.6+0.2*sin(0.7*t))") {
  return test::sceneFromText(
      "drive 0.8, load 2",
      {"motor on drive: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)", "propeller on load: -0.02*w2^2",
       std::string("variator = ExpressionConstraint, order: 2, expression: 'tau*(e2-") + ratio +
           "*e1)+w2-" + ratio + "*w1', parameters: {tau: " + plainly(tau) + "}"},
      "initial: {velocity: [5, 3]}");
}

struct Result {
  MotionStatus status;
  Sample sample;
  Statistics statistics;
};

Result run(const Scene& scene, StepperKind stepper, double tolerance, double end = kEnd) {
  Simulation simulation(test::withStepper(test::withTolerance(scene, tolerance), stepper));
  Result result;
  result.status = simulation.advanceTo(end);
  EXPECT_TRUE(result.status.ok()) << simulation.describeStatus();
  result.sample = simulation.sample();
  result.statistics = simulation.statistics();
  return result;
}

/// Largest difference of the states of two shafts, in units of tolerance (1 + |x|).
double distance(const Sample& a, const Sample& b, double tolerance) {
  double largest = 0.0;
  const auto note = [&](double x, double y) {
    const double error = std::abs(x - y) / (tolerance * (1.0 + std::abs(y)));
    largest = error <= largest ? largest : error;  // NaN is kept
  };
  for (int i = 0; i < 2; ++i) {
    note(a.angle[i], b.angle[i]);
    note(a.velocity[i], b.velocity[i]);
    note(a.acceleration[i], b.acceleration[i]);
  }
  return largest;
}

// --- accuracy ---------------------------------------------------------------------------------
// Down to 1e-11, where the tolerance is more than rounding, and across both changes of the number
// of stages.
TEST(Radau, ErrsLessTheSmallerTheTolerance) {
  const Scene scene = slipScene(1e-3);
  const Sample reference = run(scene, StepperKind::kFehlberg78, 1e-13).sample;
  for (double tolerance = 1e-2; tolerance > 0.5e-11; tolerance *= 0.1) {
    const Result result = run(scene, StepperKind::kRadau, tolerance);
    ASSERT_TRUE(result.status.ok());
    const double error = distance(result.sample, reference, 1.0);
    EXPECT_LT(error, 10.0 * tolerance) << tolerance;
  }
}

// --- auto -------------------------------------------------------------------------------------
TEST(Auto, NeedsNoMoreStepsTheShorterTheTimeConstant) {
  const Result mild = run(slipScene(1e-4), StepperKind::kAuto, 1e-6);
  for (double tau : {1e-5, 1e-6, 1e-7, 1e-8}) {
    const Result stiff = run(slipScene(tau), StepperKind::kAuto, 1e-6);
    EXPECT_LE(stiff.statistics.steps, 4 * mild.statistics.steps) << tau;
    EXPECT_LE(stiff.statistics.right_hand_sides, 4 * mild.statistics.right_hand_sides) << tau;
  }
}

TEST(Auto, SwitchesToTheImplicitStepperWhereAConstraintIsStiff) {
  for (double tolerance : {1e-4, 1e-6, 1e-8}) {
    for (double tau : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
      Simulation simulation(test::withTolerance(slipScene(tau), tolerance));
      ASSERT_TRUE(simulation.advanceTo(kEnd).ok()) << simulation.describeStatus();
      const Statistics& statistics = simulation.statistics();
      EXPECT_GE(statistics.stepper_switches, 1u) << tau << " at " << tolerance;
      EXPECT_GT(statistics.implicit_steps, 0u) << tau << " at " << tolerance;
      EXPECT_LE(statistics.implicit_steps, statistics.steps);
      EXPECT_STREQ(simulation.stepperName(), "radau") << tau << " at " << tolerance;
      simulation.reset();
      EXPECT_EQ(simulation.statistics().stepper_switches, 0u);
      EXPECT_EQ(simulation.statistics().implicit_steps, 0u);
      EXPECT_STRNE(simulation.stepperName(), "radau");
    }
  }
}

TEST(Auto, StaysExplicitOnASmoothMotion) {
  const Scene scene =
      test::sceneFromFile(std::string(VARIATOR_SIM_TEST_DIR) + "/cases/slip_ship/scene.yaml");
  for (double tolerance : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) {
    const Result result = run(scene, StepperKind::kAuto, tolerance, 10.0);
    EXPECT_EQ(result.statistics.stepper_switches, 0u) << tolerance;
    EXPECT_EQ(result.statistics.implicit_steps, 0u) << tolerance;
  }
}

TEST(Auto, NamesTheStepperThatItStartsWith) {
  const Scene scene = slipScene(0.1);
  EXPECT_STREQ(Simulation(test::withTolerance(scene, 1e-4)).stepperName(), "taylor");
  EXPECT_STREQ(Simulation(test::withTolerance(scene, 1e-8)).stepperName(), "taylor");
}

// With a constant ratio and no slip the motion is the slow one from the first instant: a few steps
// by series tell that it is stiff.
TEST(Auto, SoonStepsImplicitlyOnAStiffSlowMotion) {
  for (double tau : {1e-4, 1e-6, 1e-8}) {
    Simulation simulation(test::withTolerance(slipScene(tau, "0.6"), 1e-6));
    ASSERT_TRUE(simulation.advanceTo(1.0).ok()) << simulation.describeStatus();
    const Statistics statistics = simulation.statistics();
    const Sample first = simulation.sample();
    EXPECT_STREQ(simulation.stepperName(), "radau") << tau;
    EXPECT_GE(statistics.implicit_steps + 6, statistics.steps) << tau;
    EXPECT_LE(statistics.steps, 100u) << tau;

    simulation.reset();
    ASSERT_TRUE(simulation.advanceTo(1.0).ok());
    EXPECT_EQ(simulation.statistics().steps, statistics.steps);
    EXPECT_EQ(simulation.statistics().right_hand_sides, statistics.right_hand_sides);
    EXPECT_EQ(simulation.sample().acceleration[0], first.acceleration[0]);
  }
  EXPECT_STREQ(Simulation(test::withTolerance(slipScene(0.1, "0.6"), 1e-6)).stepperName(),
               "taylor");
}

// --- inside steps ------------------------------------------------------------------------------
// Friction that holds a shaft against a torque that swings: under the classical principle the
// accelerations follow from a creep of 1e-5 rad/s, and inside implicit steps they are of a lower
// order than the velocities.
TEST(Radau, KeepsAccelerationsInsideItsStepsWhereFrictionHolds) {
  constexpr double kTolerance = 1e-11;
  Scene scene = test::sceneFromText(
      "a 1.5, b 0.8",
      {"m on a: 2*cos(3*t)", "f = Friction, shaft: a, coulomb: 10, regularization_speed: 1e-4",
       "k: e2-0.5*e1"},
      "initial: {velocity: [1, 0.5]}\n"
      "principle: gauss");
  Scene fine = test::withStepper(test::withTolerance(scene, 1e-12), StepperKind::kFehlberg78);
  fine.solver.maximum_step = 1e-5;  // 0.6 of the creep's time constant
  Simulation reference(fine);
  Simulation simulation(
      test::withStepper(test::withTolerance(scene, kTolerance), StepperKind::kRadau));
  for (int n = 1; n <= 100; ++n) {
    const double time = 0.025 * n + 0.0037;
    ASSERT_TRUE(reference.advanceTo(time).ok()) << reference.describeStatus();
    ASSERT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
    EXPECT_NEAR(simulation.sample().acceleration[0], reference.sample().acceleration[0],
                100.0 * kTolerance)
        << time;
  }
}

Scene shipScene() {
  return test::sceneFromFile(std::string(VARIATOR_SIM_TEST_DIR) + "/cases/slip_ship/scene.yaml");
}

// Rounding of the velocities, 1/tau times as large in the accelerations, is all that is left at
// such a tolerance: shorter steps would not lessen it.
TEST(Auto, TakesFewStepsWhereRoundingOfASlipIsTheTolerance) {
  for (const double tau : {1e-7, 1e-8}) {
    const Result coarse = run(slipScene(tau), StepperKind::kAuto, 1e-7, 2.0);
    const Result fine = run(slipScene(tau), StepperKind::kAuto, 1e-10, 2.0);
    EXPECT_LT(fine.statistics.steps + fine.statistics.rejected_steps, 200U) << tau;
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(fine.sample.velocity[i], coarse.sample.velocity[i], 1e-5) << tau;
      EXPECT_NEAR(fine.sample.acceleration[i], coarse.sample.acceleration[i], 1e-4) << tau;
    }
  }
}

// --- fixed steps ------------------------------------------------------------------------------
TEST(FixedSteps, AreAsManyAsTheDurationHolds) {
  const Scene scene = slipScene(0.1);
  for (StepperKind stepper : {StepperKind::kRk4, StepperKind::kTaylorFixed}) {
    for (double step : {0.1, 0.01, 0.001}) {
      Scene fixed = test::withStepper(test::withTolerance(scene, 1e-6), stepper);
      fixed.solver.step = step;
      Simulation simulation(std::move(fixed));
      ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << simulation.describeStatus();
      const Statistics& statistics = simulation.statistics();
      EXPECT_EQ(statistics.steps, static_cast<std::uint64_t>(std::lround(2.0 / step)))
          << toString(stepper) << ", " << step;
      EXPECT_EQ(statistics.rejected_steps, 0u);
      EXPECT_EQ(statistics.stepper_switches, 0u);
      EXPECT_GT(statistics.largest_error_estimate, 0.0) << toString(stepper) << ", " << step;
      simulation.reset();
      EXPECT_EQ(simulation.statistics().largest_error_estimate, 0.0);
    }
  }
}

TEST(FixedSteps, ReportAnEstimateThatFallsWithTheStep) {
  const Scene scene = shipScene();
  double previous = 0.0;
  for (double step : {0.04, 0.02, 0.01}) {
    // (of a series nothing is left)
    Scene fixed = test::withStepper(test::withTolerance(scene, 1e-9), StepperKind::kRk4);
    fixed.solver.step = step;
    Simulation simulation(std::move(fixed));
    ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << simulation.describeStatus();
    const double estimate = simulation.statistics().largest_error_estimate;
    if (previous > 0.0) {
      EXPECT_LT(estimate, previous / 8.0) << step;
    }
    previous = estimate;
  }
  const Result adaptive = run(scene, StepperKind::kDopri5, 1e-9);
  EXPECT_EQ(adaptive.statistics.largest_error_estimate, 0.0);  // of fixed steps only
}

// Steps 1e4 times as long as tau.
TEST(FixedSteps, OfRungeKuttaAreUnstableOnAStiffScene) {
  const Scene scene = slipScene(1e-6);
  const Result reference = run(scene, StepperKind::kRadau, 1e-9);
  Scene fixed = test::withStepper(test::withTolerance(scene, 1e-6), StepperKind::kRk4);
  fixed.solver.step = 0.01;
  Simulation simulation(std::move(fixed));
  const bool arrives = simulation.advanceTo(kEnd).ok();
  EXPECT_TRUE(!arrives || distance(simulation.sample(), reference.sample, 1.0) > 1.0);
}

}  // namespace
}  // namespace variator_sim
