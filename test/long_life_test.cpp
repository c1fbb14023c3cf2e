// Late times: commands keep their whole effect, what rounding makes stops nothing, and nothing
// drifts that no constraint can change.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "support/scenes.h"

namespace variator_sim {
namespace {

std::string text(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  return buffer;
}

/// Two shafts and a slip; the drive is commanded with some hold. `t` in a law, to know the time.
std::string commanded(const std::string& hold) {
  return "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\ntorques: [qa, c]\n"
         "qa: {type: variator_sim/ExpressionTorque, shaft: b, torque: \"-0.3*w2+0*t\"}\n"
         "c: {type: variator_sim/CommandedTorque, shaft: a, topic: m, initial: 1, " +
         hold +
         "}\nconstraints: [v]\n"
         "v: {type: variator_sim/ExpressionConstraint, order: 2,\n"
         "    expression: \"0.2*(e2-0.6*e1)+w2-0.6*w1\"}\n"
         "initial: {velocity: [1, 1]}\n";
}

/// The state `after` a command at `time`.
Sample follow(const std::string& hold, double time, double after) {
  Scene scene = test::sceneFromText(commanded(hold));
  scene.solver.sleep = false;
  Simulation simulation(scene);
  EXPECT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
  EXPECT_EQ(simulation.command(0, 5.0), CommandResult::kAccepted);
  EXPECT_TRUE(simulation.advanceTo(time + after).ok()) << simulation.describeStatus();
  return simulation.sample();
}

// Ramps and lags, ever faster, at ever later times: their change of the accelerations is that of a
// jump, but for what the motion does while they last.
TEST(LateCommands, KeepTheirWholeEffect) {
  for (double time : {0.9, 1000.3, 12345.6}) {
    const Sample jump = follow("hold: zero_order", time, 0.1);
    for (double width : {1e-3, 1e-6, 1e-9, 1e-11, 1e-13, 1e-15, 1e-20}) {
      const std::string holds[] = {
          "hold: rate_limit, rate: " + text(4.0 / width),
          "hold: first_order_lag, time_constant: " + text(width),
          "hold: first_order_hold, period: " + text(width),
          "hold: second_order_lag, time_constant: " + text(width),
      };
      for (const std::string& hold : holds) {
        const Sample ramp = follow(hold, time, 0.1);
        for (int i = 0; i < 2; ++i) {
          EXPECT_NEAR(ramp.velocity[i], jump.velocity[i], 20.0 * width + 2e-7)
              << hold << " at " << time;
          EXPECT_NEAR(ramp.acceleration[i], jump.acceleration[i], 100.0 * width + 1e-7)
              << hold << " at " << time;
        }
      }
    }
  }
}

// The same command at any time of an autonomous scene at rest: the same motion from there on.
TEST(LateCommands, AreResolvedAsFinelyAsEarlyOnes) {
  for (const char* hold : {"hold: first_order_lag, time_constant: 1e-6",
                           "hold: rate_limit, rate: 1e6", "hold: zero_order"}) {
    const std::string yaml = std::string(
                                 "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\ntorques: [c]\n"
                                 "c: {type: variator_sim/CommandedTorque, shaft: a, topic: m, ") +
                             hold +
                             "}\nconstraints: [v]\n"
                             "v: {type: variator_sim/ExpressionConstraint, order: 2,\n"
                             "    expression: \"0.2*(e2-0.6*e1)+w2-0.6*w1\"}\n";
    Sample first;
    for (double time : {0.0009765625, 1024.0, 16777216.0}) {  // exact in any sum with 2^-10
      Simulation simulation(test::sceneFromText(yaml));
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

// psi reads 0.7 t, which is known to a rounding of t only. That moves the projection by more than
// the tolerance late in life: it is told and stops nothing.
TEST(LateTimes, RoundingOfTheTimeStopsNothing) {
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    for (double late : {5e4, 1e6, 1e7}) {
      Scene scene = test::sceneFromText(
          "shafts: [a, b]\na: {inertia: 0.8}\nb: {inertia: 2}\ntorques: [m, p]\n"
          "m: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"60-0.02*w1\"}\n"
          "p: {type: variator_sim/ExpressionTorque, shaft: b, torque: \"-0.00002*w2^2\"}\n"
          "constraints: [v]\n"
          "v: {type: variator_sim/ExpressionConstraint, order: 2,\n"
          "    expression: \"0.2*(e2-(0.6+0.2*sin(0.7*(t+" +
          text(late) + ")))*e1) + w2-(0.6+0.2*sin(0.7*(t+" + text(late) +
          ")))*w1\"}\n"
          "initial: {velocity: [2000, 1200]}\nprinciple: " +
          std::string(principle) + "\n");
      Simulation simulation(scene);
      EXPECT_TRUE(simulation.advanceTo(20.0).ok())
          << principle << " " << late << " " << simulation.describeStatus();
      EXPECT_LT(simulation.statistics().steps, 100000u);
      if (late == 1e7 && principle == std::string("generalized_gauss")) {
        EXPECT_GT(simulation.statistics().largest_rounding, 1.0);
      }
    }
  }
}

// The null-space component of the reaction is a constant of the motion: a free shaft never has one,
// and with constant C the reaction stays on R(0) + range(C^T).
TEST(NeutralModes, DoNotDrift) {
  // A sample lies inside a step; errors of steps that added up would be ten times that.
  constexpr double kInsideOfAStep = 3e-9;
  const std::string torques =
      "torques: [qa]\n"
      "qa: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"sin(t)-0.1*w1-0.02*w1^3\"}\n";
  for (const char* stepper : {"auto", "dopri5", "fehlberg78", "radau", "rk4"}) {
    Simulation alone(test::sceneFromText("shafts: [a]\na: {inertia: 1}\n" + torques +
                                         "solver: {stepper: " + std::string(stepper) +
                                         ", step: 0.01}\n"));
    ASSERT_TRUE(alone.advanceTo(20000.0).ok()) << alone.describeStatus();
    EXPECT_NEAR(alone.sample().reaction_torque[0], 0.0, kInsideOfAStep) << stepper;

    // c2 R1 - c1 R2 with C = (-1/2, 1), beside a shaft that no constraint reads
    Simulation gear(test::sceneFromText(
        "shafts: [a, b, c]\na: {inertia: 1}\nb: {inertia: 2}\nc: {inertia: 3}\n"
        "torques: [qa, qc]\n"
        "qa: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"sin(t)-0.1*w1-0.02*w1^3\"}\n"
        "qc: {type: variator_sim/ExpressionTorque, shaft: c, torque: \"cos(2*t)-0.1*w3\"}\n"
        "constraints: [k]\n"
        "k: {type: variator_sim/ExpressionConstraint, order: 2, expression: \"e2-0.5*e1\"}\n"
        "initial: {acceleration: [2, 1, 0.5]}\nsolver: {stepper: " +
        std::string(stepper) + ", step: 0.01}\n"));
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
