// Late times: commands are resolved as finely as early ones, and nothing drifts that no constraint
// can change. (test/stress/long_lives_test.cpp has ramps and formulas of late times.)
#include "support/scenes.h"

namespace variator_sim {
namespace {

// The same command at any time of an autonomous scene at rest: the same motion from there on.
TEST(LateCommands, AreResolvedAsFinelyAsEarlyOnes) {
  for (const char* hold : {"hold: first_order_lag, time_constant: 1e-6",
                           "hold: rate_limit, rate: 1e6", "hold: zero_order"}) {
    const Scene scene = test::sceneFromText(
        "a 1, b 2", {std::string("c on a from m, ") + hold, "v: 0.2*(e2-0.6*e1)+w2-0.6*w1"});
    Sample first;
    for (double time : {0.0009765625, 1024.0, 16777216.0}) {  // exact in any sum with 2^-10
      Simulation simulation(scene);
      ASSERT_TRUE(simulation.advanceTo(time).ok());
      simulation.command(0, 5.0);
      ASSERT_TRUE(simulation.advanceTo(time + 0.25).ok()) << simulation.describeStatus();
      const Sample& sample = simulation.sample();
      if (time < 1.0) {
        first = sample;
        continue;
      }
      for (int i = 0; i < 2; ++i) {
        EXPECT_NEAR(sample.velocity[i], first.velocity[i], 1e-13) << hold << " at " << time;
        EXPECT_NEAR(sample.acceleration[i], first.acceleration[i], 1e-13) << hold << " at " << time;
      }
    }
  }
}

// The null-space component of the reaction is a constant of the motion: a free shaft never has one,
// and with constant C the reaction stays on R(0) + range(C^T).
TEST(NeutralModes, DoNotDrift) {
  // A sample lies inside a step; errors of steps that added up would be ten times that.
  constexpr double kInsideOfAStep = 3e-9;
  const std::string torque = "qa on a: sin(t)-0.1*w1-0.02*w1^3";
  for (const char* stepper : {"auto", "dopri5", "fehlberg78", "radau", "rk4"}) {
    const std::string solver = "solver: {stepper: " + std::string(stepper) + ", step: 0.01}";
    Simulation alone(test::sceneFromText("a 1", {torque}, solver));
    ASSERT_TRUE(alone.advanceTo(20000.0).ok()) << alone.describeStatus();
    EXPECT_NEAR(alone.sample().reaction_torque[0], 0.0, kInsideOfAStep) << stepper;

    // c2 R1 - c1 R2 with C = (-1/2, 1), beside a shaft that no constraint reads
    Simulation gear(test::sceneFromText("a 1, b 2, c 3",
                                        {torque, "qc on c: cos(2*t)-0.1*w3", "k: e2-0.5*e1"},
                                        "initial: {acceleration: [2, 1, 0.5]}\n" + solver));
    const Sample start = gear.sample();
    ASSERT_TRUE(gear.advanceTo(20000.0).ok()) << gear.describeStatus();
    const Sample& end = gear.sample();
    EXPECT_NEAR(end.reaction_torque[0] + 0.5 * end.reaction_torque[1],
                start.reaction_torque[0] + 0.5 * start.reaction_torque[1], kInsideOfAStep)
        << stepper;
    EXPECT_NEAR(end.reaction_torque[2], start.reaction_torque[2], kInsideOfAStep) << stepper;
  }
}

// A free shaft whose inertia depends on its angle: R' = Gamma R omega [6] and
// J epsilon + 1/2 J' omega^2 = R, so R / sqrt(J) is a constant r, and sqrt(J) omega grows by r t.
TEST(NeutralModes, OfInertiasThatDependOnTheAngleFollowThem) {
  Scene scene = test::sceneFromText(
      "shafts: [a, b]\na: {inertia: {mean: 1.2, harmonics: [{order: 2, cos: 0.3, sin: -0.2}]}}\n"
      "b: {inertia: {mean: 0.9, harmonics: [{order: 1, cos: 0.1, sin: 0.3}]}}\n"
      "initial: {angle: [0.3, -0.4], velocity: [2, 5], acceleration: [3, -1]}\n");
  const auto J = [](int shaft, double phi) {
    return shaft == 0 ? 1.2 + 0.3 * std::cos(2.0 * phi) - 0.2 * std::sin(2.0 * phi)
                      : 0.9 + 0.1 * std::cos(phi) + 0.3 * std::sin(phi);
  };
  for (StepperKind stepper :
       {StepperKind::kDopri5, StepperKind::kFehlberg78, StepperKind::kRadau}) {
    Simulation simulation(test::withStepper(scene, stepper));
    const Sample start = simulation.sample();
    for (double t : {0.1, 0.5, 1.7, 4.0, 9.0}) {
      ASSERT_TRUE(simulation.advanceTo(t).ok()) << simulation.describeStatus();
      const Sample& now = simulation.sample();
      for (int i = 0; i < 2; ++i) {
        const double r = start.reaction_torque[i] / std::sqrt(J(i, start.angle[i]));
        const double expected = std::sqrt(J(i, start.angle[i])) * start.velocity[i] + r * t;
        EXPECT_NEAR(std::sqrt(J(i, now.angle[i])) * now.velocity[i], expected, 2e-7)
            << toString(stepper) << ", " << t;
        EXPECT_NEAR(now.reaction_torque[i], r * std::sqrt(J(i, now.angle[i])), 2e-6);
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim
