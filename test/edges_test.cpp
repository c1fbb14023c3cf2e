// Events inside a step: corners and jumps of laws.
// (test/known_motions.yaml has more of them, test/stress/pulses_test.cpp and law_jumps_test.cpp
// those of steps that keep a tolerance.)

#include "support/scenes.h"

namespace variator_sim {
namespace {

// Beside a psi that is curved in the accelerations their way counts, not its ends alone. On the
// circle e1 = g cos(a), e2 = g sin(a), with e3 = r e2 + d and d going from 0 to D, J = diag(1, 1,
// J3):
//     g^2 a'^2 + J3 (r g cos(a) a' + D)^2 is least  =>  (1 / cos(a) + J3 r^2 cos(a)) a' = -J3 r D /
//     g,
// so that atanh(x) + J3 r^2 x, x = sin(a) = e2 / g, changes by -J3 r D / g.
TEST(KinksOfOrder1, GoAlongACurvedConstraint) {
  const double g = 1.5;
  const double r = 1.2;
  const double D = 1.6;
  const double J3 = 2.0;
  Simulation simulation(
      test::sceneFromText("a 1, b 1, c 2",
                          {"m = AccelerationMagnitude, shafts: [a, b], magnitude: 1.5",
                           "v of order 1: w3-1.2*w2-1.6*max(0,t-1)"},
                          "initial: {acceleration: [1.2, 0.9, 1.08]}"));
  const auto invariant = [&](double e2) { return std::atanh(e2 / g) + J3 * r * r * e2 / g; };
  ASSERT_TRUE(simulation.advanceTo(1.0 - 1e-7).ok()) << simulation.describeStatus();
  const double before = simulation.sample().acceleration[1];
  ASSERT_TRUE(simulation.advanceTo(1.0 + 1e-7).ok()) << simulation.describeStatus();
  const double* after = simulation.sample().acceleration;
  EXPECT_NEAR(invariant(after[1]) - invariant(before), -J3 * r * D / g, 1e-5);
  EXPECT_NEAR(after[2], r * after[1] + D, 1e-6);
  EXPECT_GT(std::abs(after[1] - before), 0.5);
}

// psi with a corner in the accelerations, at e1 = -0.5, is the limit of smooth ones.
TEST(CornersOfPsi, ArePassed) {
  const auto ratio = [](const char* magnitude) {
    return Simulation(
        test::sceneFromText("a 1.5, b 0.8",
                            {"q on a: 3*sin(3*t)-0.4*w1",
                             std::string("v: 0.2*(e2-0.4*e1)+w2-0.4*w1+0.02*") + magnitude},
                            "initial: {velocity: [2, 0.8]}"));
  };
  Simulation cornered = ratio("abs(e1+0.5)");
  Simulation smooth = ratio("sqrt((e1+0.5)^2+1e-14)");
  ASSERT_TRUE(cornered.advanceTo(6.0).ok()) << cornered.describeStatus();
  ASSERT_TRUE(smooth.advanceTo(6.0).ok()) << smooth.describeStatus();
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(cornered.sample().velocity[i], smooth.sample().velocity[i], 1e-6);
    EXPECT_NEAR(cornered.sample().acceleration[i], smooth.sample().acceleration[i], 1e-6);
  }
  EXPECT_LT(cornered.statistics().steps, 100U);
}

/// Accelerations of least reaction along a psi that is not linear in them, under a torque that
/// jumps and under one that rises ever faster. A command and a formula of the time may jump.
Simulation curvedRatio(const std::string& pulse, const char* stepper) {
  return Simulation(test::sceneFromText(
      "drive 0.5, load 1.2",
      {"motor on drive: 8*(1-w1/40)", "drag on load: -0.1*w2", pulse,
       "k: 0.5*(e2-0.8*e1)+0.01*(e1^2+e1*e2)+w2-0.8*w1"},
      "initial: {velocity: [10, 8]}\nprinciple: gauss\nsolver: {stepper: " + std::string(stepper) +
          "}"));
}

TEST(TorquesThatJump, LeadLeastReactionsWhereRampsDo) {
  for (const int size : {3, 8, -6}) {
    const std::string height = std::to_string(size);
    const std::string pulse = "pulse on drive";
    Simulation ramp = curvedRatio(pulse + ": " + height + "*clamp((t-1)/1e-5, 0, 1)", "fehlberg78");
    ASSERT_TRUE(ramp.advanceTo(1.2).ok()) << ramp.describeStatus();
    for (const char* stepper : {"auto", "dopri5", "radau", "taylor"}) {
      SCOPED_TRACE(height + " N m by " + stepper);
      Simulation formula = curvedRatio(pulse + ": if(t < 1, 0, " + height + ")", stepper);
      ASSERT_TRUE(formula.advanceTo(1.2).ok()) << formula.describeStatus();
      Simulation command = curvedRatio(pulse + " from p", stepper);
      ASSERT_TRUE(command.advanceTo(1.0).ok()) << command.describeStatus();
      command.command(0, size);
      ASSERT_TRUE(command.advanceTo(1.2).ok()) << command.describeStatus();
      for (int i = 0; i < 2; ++i) {
        EXPECT_NEAR(formula.sample().velocity[i], ramp.sample().velocity[i], 1e-3) << i;
        EXPECT_NEAR(formula.sample().acceleration[i], ramp.sample().acceleration[i], 1e-2) << i;
        EXPECT_NEAR(formula.sample().velocity[i], command.sample().velocity[i], 1e-7) << i;
        EXPECT_NEAR(formula.sample().acceleration[i], command.sample().acceleration[i], 1e-6) << i;
      }
    }
  }
}

/// A clamped contact torque of 1 N m that 1.5 N m on shaft a exceed: behind the edge both shafts
/// have 0.5 rad/s^2, so that the motion goes on along the edge, where rounding chooses the side.
/// Samples of it are of their own instant.
TEST(CrossedEdges, AreSampledAtTheInstantAsked) {
  const double width = 1e-5;  // rad/s
  for (const StepperKind stepper :
       {StepperKind::kAuto, StepperKind::kRadau, StepperKind::kTaylor}) {
    const Scene scene = test::sceneFromText(
        "a 1, b 2",
        {"load on a: 1.5",
         "law = ExpressionTorque, shaft: a, torque: '-clamp((w1-w2)/1e-5,-1,1)', reaction_on: b"});
    Simulation simulation(test::withTolerance(test::withStepper(scene, stepper), 1e-9));
    for (int n = 1; n <= 400; ++n) {
      const double t = 0.005 * n;
      ASSERT_TRUE(simulation.advanceTo(t).ok()) << simulation.describeStatus();
      ASSERT_NEAR(simulation.sample().velocity[0], 0.5 * t, 2.0 * width) << t;
      ASSERT_NEAR(simulation.sample().velocity[1], 0.5 * t, 2.0 * width) << t;
    }
  }
}

}  // namespace
}  // namespace variator_sim
