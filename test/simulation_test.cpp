// The promises of Simulation beside the physics: commands act together and exactly in time, every
// stop has a name, bad values are rejected. (test/stress/repeatability_test.cpp has that samples,
// cuts, resets and repeated commands change no bit.)

#include "support/scenes.h"
#include "variator_sim/interruption.h"

namespace variator_sim {
namespace {

const std::string kTwoCommands = test::sceneText(
    "drive 0.5, load 1.2",
    {"engine on drive from drive_torque, hold: zero_order",
     "brake on load from load_torque, hold: first_order_lag, time_constant: 0.05, gain: -1, min: "
     "-20, max: 20",
     "friction on load: -0.3*w2", "variator: 0.5*(e2-0.8*e1)+0.01*(e1^2+e1*e2)+w2-0.8*w1"},
    "initial: {velocity: [10, 8]}");

TEST(Simulation, CommandsAreRefusedClampedAndCounted) {
  Simulation simulation(test::sceneFromText(kTwoCommands));
  simulation.advanceTo(0.1);
  EXPECT_EQ(simulation.command(0, std::nan("")), CommandResult::kRefused);
  EXPECT_EQ(simulation.command(0, HUGE_VAL), CommandResult::kRefused);
  EXPECT_EQ(simulation.command(1, 1e6), CommandResult::kClamped);
  EXPECT_EQ(simulation.command(0, 1.0), CommandResult::kAccepted);
  const Sample& sample = simulation.sample();
  EXPECT_EQ(sample.applied_torque[0], 1.0);
  EXPECT_EQ(simulation.statistics().commands_refused, 2u);
  EXPECT_EQ(simulation.statistics().commands_clamped, 1u);
  EXPECT_EQ(simulation.statistics().commands_accepted, 2u);
  // the lag tends to the clamped value
  simulation.advanceTo(5.0);
  const Sample& later = simulation.sample();
  EXPECT_NEAR(later.applied_torque[1], -20.0 - 0.3 * later.velocity[1], 1e-9);
}

TEST(Simulation, AZeroOrderCommandAtTimeZeroIsTheInitialValue) {
  Simulation simulation(test::sceneFromText(kTwoCommands));
  const Sample without = simulation.sample();
  simulation.command(0, 4.0);
  simulation.command(1, 3.0);  // lagged: its torque starts at `initial`
  const Sample with = simulation.sample();
  EXPECT_EQ(simulation.statistics().jumps, 0u);
  EXPECT_EQ(with.applied_torque[0], 4.0);
  EXPECT_EQ(with.applied_torque[1], without.applied_torque[1]);
  EXPECT_NE(with.acceleration[0], without.acceleration[0]);
  EXPECT_NEAR(with.residual[0], 0.0, 1e-14);
  // least reaction: R = C^T lambda
  const double c1 = -0.4 + 0.01 * (2.0 * with.acceleration[0] + with.acceleration[1]);
  const double c2 = 0.5 + 0.01 * with.acceleration[0];
  EXPECT_NEAR(c2 * with.reaction_torque[0] - c1 * with.reaction_torque[1], 0.0, 1e-12);
}

TEST(Simulation, IsQuietUntilTheNextStepACommandOrItsTimeout) {
  Simulation simulation(test::sceneFromText(
      "drive 2",
      {"motor on drive from torque, timeout: 0.5, on_timeout: zero", "drag on drive: -w1"},
      "initial: {velocity: [10]}"));
  EXPECT_EQ(simulation.quietUntil(), 0.0);  // no step made yet
  simulation.advanceTo(0.9);
  const double end = simulation.quietUntil();
  ASSERT_GT(end, 0.9);
  const std::uint64_t steps = simulation.statistics().steps;
  simulation.advanceTo(end);
  EXPECT_EQ(simulation.statistics().steps, steps);
  EXPECT_EQ(simulation.quietUntil(), end);
  simulation.advanceTo(end + 1e-9);
  EXPECT_EQ(simulation.statistics().steps, steps + 1);

  simulation.advanceTo(end + 0.01);
  simulation.command(0, 4.0);
  EXPECT_EQ(simulation.quietUntil(), end + 0.01);
  simulation.advanceTo(end + 0.5);
  EXPECT_GT(simulation.quietUntil(), end + 0.5 - 1e-9);
  EXPECT_LE(simulation.quietUntil(), end + 0.51);
}

// --- starts -----------------------------------------------------------------------------------
TEST(InitialConditions, LeastReactionIsFoundFarFromTheFreeAccelerations) {
  // An elastic coupling's torque alone would give the light shaft 600 rad/s^2, where the cubic psi
  // is steep; plain Newton from there goes astray.
  Simulation simulation(
      test::sceneFromText("input 10, screw 400",
                          {"coupling on input: 6000", "propeller on screw: -6000+t",
                           "variator: 0.5*(e2-0.22*e1)*(1+0.02*(e1^2+e2^2))+w2-0.22*w1"},
                          "initial: {velocity: [60, 12.4]}"));
  ASSERT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  const Sample& s = simulation.sample();
  EXPECT_NEAR(s.residual[0], 0.0, 1e-12);
  // R = C^T lambda
  const double e1 = s.acceleration[0];
  const double e2 = s.acceleration[1];
  const double g = 1 + 0.02 * (e1 * e1 + e2 * e2);
  const double C1 = 0.5 * (-0.22 * g + (e2 - 0.22 * e1) * 0.04 * e1);
  const double C2 = 0.5 * (g + (e2 - 0.22 * e1) * 0.04 * e2);
  EXPECT_NEAR((C2 * s.reaction_torque[0] - C1 * s.reaction_torque[1]) / 6000.0, 0.0, 1e-12);
}

// --- stops ------------------------------------------------------------------------------------
TEST(Stops, AVanishingConstraintIsNamed) {
  // c = 2 (eps1 - 1 + t) goes to zero while psi forces it to: psi = (eps1 - 1 + t)^2 + t - 0.5
  Simulation simulation(test::sceneFromText("drive 1, load 1", {"variator: (e1-1)^2+t-0.5"},
                                            "initial: {acceleration: [1.7071067811865475, 0]}"));
  const MotionStatus& status = simulation.advanceTo(2.0);
  EXPECT_EQ(status.reason, StopReason::kSingularConstraint);
  EXPECT_EQ(status.constraint, 0);
  EXPECT_NEAR(status.time, 0.5, 1e-6);
  EXPECT_EQ(simulation.time(), status.time);
  const std::string text = simulation.describeStatus();
  EXPECT_NE(text.find("SingularConstraint"), std::string::npos);
  EXPECT_NE(text.find("'variator'"), std::string::npos);
  EXPECT_TRUE(std::isfinite(simulation.sample().acceleration[0]));
  // stopped until reset
  simulation.advanceTo(3.0);
  EXPECT_EQ(simulation.time(), status.time);
  simulation.reset();
  EXPECT_TRUE(simulation.status().ok());
  EXPECT_TRUE(simulation.advanceTo(0.1).ok());
}

TEST(Stops, TooManyStepsAreNamed) {
  Scene scene = test::sceneFromText(kTwoCommands);
  scene.solver.maximum_steps = 5;
  scene.solver.stepper = StepperKind::kDopri5;
  Simulation simulation(std::move(scene));
  EXPECT_EQ(simulation.advanceTo(100.0).reason, StopReason::kStepLimit);
  EXPECT_EQ(simulation.statistics().steps, 5u);
}

TEST(Stops, AJumpThatLeavesTheConstraintIsNamed) {
  // psi = eps1^2 - eps2^3 has a cusp at 0, where C = 0; a braking torque on shaft 2 leads into it.
  Simulation simulation(test::sceneFromText("drive 1, load 1",
                                            {"brake on load from torque", "variator: e1^2-e2^3"},
                                            "initial: {acceleration: [1, 1]}"));
  simulation.advanceTo(0.1);
  simulation.command(0, -10.0);
  simulation.sample();
  EXPECT_EQ(simulation.status().reason, StopReason::kJumpFailed) << simulation.describeStatus();
  EXPECT_NE(simulation.describeStatus().find("'variator'"), std::string::npos);
  // the last good state is the one before the jump
  EXPECT_NEAR(simulation.sample().acceleration[0], 1.0, 1e-12);
}

// Ends of ramps that are meant for one instant, but a rounding apart, leave no time for a step.
TEST(Simulation, GoesOnWhereRampsEndTogether) {
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    Simulation simulation(
        test::sceneFromText("a 0.8, b 2",
                            {"m on a from u, hold: first_order_hold, period: 0.1",
                             "n on b from v, hold: rate_limit, rate: 3",
                             "slip = SlipRatio, shafts: [a, b], time_constant: 0.1, ratio: 0.5"},
                            std::string("initial: {velocity: [4, 2]}\nprinciple: ") + principle));
    int apart = 0;
    for (int k = 1; k <= 100; ++k) {
      const double begin = 0.001 * k;
      apart += begin + 0.1 != begin + 0.3 / 3.0;
      simulation.reset();
      simulation.advanceTo(begin);
      simulation.command(0, 1.0);
      simulation.command(1, 0.3);
      simulation.advanceTo(begin + 0.3);
      ASSERT_TRUE(simulation.status().ok()) << begin << ": " << simulation.describeStatus();
      EXPECT_NEAR(simulation.sample().applied_torque[0], 1.0, 1e-12);
      EXPECT_NEAR(simulation.sample().applied_torque[1], 0.3, 1e-12);
    }
    EXPECT_GT(apart, 10);
  }
}

// Wherever it is interrupted a motion is where it has come to, and goes on from there.
TEST(Interruptions, LeaveAMotionThatGoesOn) {
  const auto make = [] {
    Scene scene = test::sceneFromText(kTwoCommands);
    scene.solver.maximum_step = 0.02;
    Simulation simulation(std::move(scene));
    simulation.trackEnergy(true);
    simulation.command(0, 3.0);
    return simulation;
  };
  Simulation whole = make();
  whole.advanceTo(2.0);
  const Sample& expected = whole.sample();
  int interrupted = 0;
  for (int n = 1; n <= 60; ++n) {
    Simulation simulation = make();
    {
      int asked = 0;
      const Interruption interruption([&] { return ++asked >= n; });
      ASSERT_TRUE(simulation.advanceTo(2.0).ok());
      const double time = simulation.time();
      ASSERT_LE(time, 2.0);
      interrupted += time < 2.0;
      EXPECT_EQ(simulation.sample().time, time);
      EXPECT_TRUE(std::isfinite(simulation.sample().acceleration[1]));
      // Nothing moves as long as it lasts.
      if (time < 2.0) {
        simulation.advanceTo(2.0);
        EXPECT_EQ(simulation.time(), time);
      }
    }
    ASSERT_TRUE(simulation.advanceTo(2.0).ok());
    const Sample& reached = simulation.sample();
    EXPECT_EQ(reached.time, 2.0);
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(reached.velocity[i], expected.velocity[i], 1e-8) << n;
      EXPECT_NEAR(reached.acceleration[i], expected.acceleration[i], 1e-7) << n;
    }
    EXPECT_NEAR(reached.energy.applied, expected.energy.applied, 1e-6) << n;
  }
  EXPECT_GT(interrupted, 10);
}

// A command's timeout behind the interruption is no event yet.
TEST(Interruptions, LeaveTimeoutsToCome) {
  Simulation simulation(test::sceneFromText("a 1", {"m on a from u, timeout: 0.5"}));
  simulation.command(0, 1.0);
  {
    const Interruption interruption([] { return true; });
    simulation.advanceTo(2.0);
    EXPECT_LT(simulation.time(), 0.5);
    EXPECT_EQ(simulation.statistics().command_timeouts, 0U);
  }
  simulation.advanceTo(2.0);
  EXPECT_EQ(simulation.statistics().command_timeouts, 1U);
}

}  // namespace
}  // namespace variator_sim
