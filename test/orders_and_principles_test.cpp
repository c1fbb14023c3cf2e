// Constraints of order 1, 2 and 3, the two principles, inertia that depends on the angle: what one
// says of another.

#include "support/faults.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

struct Scene2 {
  std::string constraint;  // the dictionary's entries
  std::string initial;
  std::string principle = "generalized_gauss";
  std::string drive_torque = "12*((50-w1)/50)/(((50-w1)/50)^2+0.04)";
};

/// Two shafts, a motor and a propeller, one constraint.
Simulation simulate(const Scene2& scene, double tolerance = 1e-11) {
  Scene read = test::sceneFromText(
      "drive 0.8, load 2",
      {std::string("motor on drive: ") + scene.drive_torque, "propeller on load: -0.02*w2^2",
       std::string("variator = ExpressionConstraint, ") + scene.constraint},
      std::string("principle: ") + scene.principle + "\ninitial: " + scene.initial);
  return Simulation(
      test::withStepper(test::withTolerance(std::move(read), tolerance), StepperKind::kDopri5));
}

void expectSameMotion(Simulation& a, Simulation& b, double end, double tolerance) {
  for (int n = 0; n <= 10; ++n) {
    const double t = end * n / 10;
    ASSERT_TRUE(a.advanceTo(t).ok()) << a.describeStatus();
    ASSERT_TRUE(b.advanceTo(t).ok()) << b.describeStatus();
    const Sample x = a.sample();
    const Sample y = b.sample();
    for (int i = 0; i < 2; ++i) {
      ASSERT_NEAR(x.angle[i], y.angle[i], tolerance) << t;
      ASSERT_NEAR(x.velocity[i], y.velocity[i], tolerance) << t;
      ASSERT_NEAR(x.acceleration[i], y.acceleration[i], tolerance) << t;
      ASSERT_NEAR(x.reaction_torque[i], y.reaction_torque[i], tolerance) << t;
      ASSERT_NEAR(x.reaction_torque_rate[i], y.reaction_torque_rate[i], 10.0 * tolerance) << t;
    }
  }
}

// omega2 = i(t) omega1, differentiated by hand: the same motion from every order.
const char* const kOrder1 = "order: 1, expression: \"w2-(0.6+0.1*sin(0.7*t))*w1\"";
const char* const kOrder2 =
    "order: 2, expression: \"e2-(0.6+0.1*sin(0.7*t))*e1-0.07*cos(0.7*t)*w1\"";
const char* const kOrder3 =
    "order: 3, expression: \"j2-(0.6+0.1*sin(0.7*t))*j1-0.14*cos(0.7*t)*e1+0.049*sin(0.7*t)*w1\"";
// consistent with all three: e2 = 0.6 e1 + 0.07 w1; a reaction that is not C^T lambda
const char* const kStart = "{velocity: [5, 3], acceleration: [4, 2.75]}";

TEST(Orders, TheSameConstraintOfEveryOrderIsTheSameMotion) {
  Simulation first = simulate({kOrder1, kStart});
  Simulation second = simulate({kOrder2, kStart});
  expectSameMotion(first, second, 5.0, 1e-8);
  Simulation again = simulate({kOrder2, kStart});
  Simulation third = simulate({kOrder3, kStart});
  expectSameMotion(again, third, 5.0, 1e-8);
}

TEST(Orders, Order1IsKeptInVelocitiesAndAccelerations) {
  Simulation simulation = simulate({kOrder1, kStart}, 1e-5);
  for (int n = 1; n <= 100; ++n) {
    ASSERT_TRUE(simulation.advanceTo(n).ok());
    const Sample& s = simulation.sample();
    const double ratio = 0.6 + 0.1 * std::sin(0.7 * n);
    ASSERT_NEAR(s.residual[0], 0.0, 1e-13 * 60.0);
    ASSERT_NEAR(s.acceleration[1],
                ratio * s.acceleration[0] + 0.07 * std::cos(0.7 * n) * s.velocity[0], 1e-12);
  }
}

TEST(Orders, InconsistentVelocitiesNameResidualAndNearest) {
  test::expectRefused("initial/velocity", {"'variator' = 0.5"}, [&] {
    simulate({kOrder1, "{velocity: [5, 3.5]}"});
  });
  Simulation moved = simulate({kOrder1, "{velocity: [5, 3.5], project: true}"});
  const Sample& s = moved.sample();
  EXPECT_NEAR(s.velocity[1], 0.6 * s.velocity[0], 1e-14);
  // nearest in the metric J: the change is along J^-1 C^T = (-0.6 / 0.8, 1 / 2)
  EXPECT_NEAR((s.velocity[0] - 5.0) / (s.velocity[1] - 3.5), -0.75 / 0.5, 1e-12);
}

TEST(Orders, ANonlinearOrder3IsAllowedInEpsilonOnly) {
  EXPECT_THROW(simulate({"order: 3, expression: \"j1*j2-1\"", kStart}), SceneError);
  EXPECT_THROW(simulate({"order: 3, expression: \"e1-e2\"", kStart}), SceneError);
  EXPECT_THROW(simulate({"order: 1, expression: \"e1-w2\"", kStart}), SceneError);
  EXPECT_THROW(simulate({"order: 1, expression: \"phi1-phi2\"", kStart}), SceneError);
}

// psi = eps1^2 + eps2^2 - a^2 given as its derivative, eps1 eta1 + eps2 eta2 = 0.
TEST(Orders, TheAccelerationCircleByItsDerivative) {
  const char* const start = "{acceleration: [1.2, 1.6]}";
  Simulation second = simulate({"order: 2, expression: \"e1^2+e2^2-4\"", start});
  Simulation third = simulate({"order: 3, expression: \"e1*j1+e2*j2\"", start});
  expectSameMotion(second, third, 3.0, 1e-8);
}

TEST(Orders, MixInOneScene) {
  Simulation simulation(test::withTolerance(
      test::sceneFromText("a 0.5, b 1, c 2, d 0.7",
                          {"motor on a: 20-w1", "drag on d: -0.5*w4", "gear of order 1: w2-0.5*w1",
                           "slip: 0.1*(e3-0.7*e2)+w3-0.7*w2", "start of order 3: j4-0.3*cos(t)"},
                          "inertia_coupling: [[a, c, 0.1]]\n"
                          "initial: {velocity: [2, 1, 0.5, 0]}"),
      1e-11));
  const Sample first = simulation.sample();
  for (int n = 1; n <= 20; ++n) {
    const double t = 0.2 * n;
    ASSERT_TRUE(simulation.advanceTo(t).ok()) << simulation.describeStatus();
    const Sample& s = simulation.sample();
    for (int m = 0; m < 3; ++m) ASSERT_NEAR(s.residual[m], 0.0, 1e-12) << m;
    ASSERT_NEAR(s.velocity[1], 0.5 * s.velocity[0], 1e-12);
    ASSERT_NEAR(s.velocity[2] - 0.7 * s.velocity[1], (0.5 - 0.7) * std::exp(-t / 0.1), 1e-9);
    ASSERT_NEAR(s.acceleration[3], first.acceleration[3] + 0.3 * std::sin(t), 1e-9);
  }
}

// --- principles -------------------------------------------------------------------------------
/// A start of order 3 with the accelerations of a sample.
std::string startWith(const Sample& sample) {
  return "{velocity: [5, 3], acceleration: " +
         test::list({sample.acceleration[0], sample.acceleration[1]}) + "}";
}

/// C of the ratio constraint at t, for any order.
void calcRatioRow(double t, double* C) {
  C[0] = -(0.6 + 0.1 * std::sin(0.7 * t));
  C[1] = 1.0;
}

// [17]: R . h = 0, C h = 0, beside psi = 0: a linear system for the accelerations at each state.
TEST(Principles, GaussIsEquation17ForLinearConstraints) {
  Simulation simulation = simulate({kOrder2, "{velocity: [5, 3]}", "gauss"});
  for (int n = 0; n <= 20; ++n) {
    const double t = 0.25 * n;
    ASSERT_TRUE(simulation.advanceTo(t).ok());
    const Sample& s = simulation.sample();
    double C[2];
    calcRatioRow(t, C);
    // h = (C2, -C1):  C2 (J1 e1 - Q1) - C1 (J2 e2 - Q2) = 0;  C1 e1 + C2 e2 = 0.07 cos(0.7 t) w1
    const double a11 = C[1] * 0.8;
    const double a12 = -C[0] * 2.0;
    const double b1 = C[1] * s.applied_torque[0] - C[0] * s.applied_torque[1];
    const double b2 = 0.07 * std::cos(0.7 * t) * s.velocity[0];
    const double determinant = a11 * C[1] - a12 * C[0];
    EXPECT_NEAR(s.acceleration[0], (b1 * C[1] - a12 * b2) / determinant, 1e-12);
    EXPECT_NEAR(s.acceleration[1], (a11 * b2 - C[0] * b1) / determinant, 1e-12);
  }
}

/// R' against a fourth-order difference of R over samples of the same motion.
void expectReactionRate(Simulation& simulation, double t) {
  constexpr double kStep = 1e-3;
  double reaction[5][2];
  double rate[2];
  for (int n = -2; n <= 2; ++n) {
    ASSERT_TRUE(simulation.advanceTo(t + n * kStep).ok());
    const Sample& s = simulation.sample();
    for (int i = 0; i < 2; ++i) {
      reaction[n + 2][i] = s.reaction_torque[i];
      if (n == 0) rate[i] = s.reaction_torque_rate[i];
    }
  }
  for (int i = 0; i < 2; ++i) {
    const double difference =
        (reaction[0][i] - 8 * reaction[1][i] + 8 * reaction[3][i] - reaction[4][i]) / (12 * kStep);
    EXPECT_NEAR(rate[i], difference, 1e-6 * std::max(1.0, std::abs(difference))) << t;
  }
}

TEST(Principles, ReactionRatesAreThoseOfTheMotion) {
  const char* const kNonlinear =
      "order: 2, expression: \"0.2*(e2-0.6*e1)*(1+0.05*(e1^2+e2^2))+w2-0.6*w1+0.1*sin(t)\"";
  for (const std::string principle : {"gauss", "generalized_gauss"}) {
    for (const char* constraint : {kOrder1, kOrder2, kOrder3, kNonlinear}) {
      Simulation simulation = simulate({constraint, "{velocity: [5, 3]}", principle}, 1e-12);
      for (double t : {0.5, 1.5, 4.0}) expectReactionRate(simulation, t);
    }
  }
}

// Nonlinear psi under `gauss`: at every sample psi = 0 and R in range(C^T).
TEST(Principles, GaussSolvesNonlinearConstraintsToRoundOff) {
  Simulation simulation =
      simulate({"order: 2, expression: \"0.2*(e2-0.6*e1)*(1+0.05*(e1^2+e2^2))+w2-0.6*w1\"",
                "{velocity: [5, 2]}", "gauss"});
  for (int n = 0; n <= 100; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.2 * n).ok()) << simulation.describeStatus();
    const Sample& s = simulation.sample();
    const double e1 = s.acceleration[0];
    const double e2 = s.acceleration[1];
    const double g = 1 + 0.05 * (e1 * e1 + e2 * e2);
    const double C1 = 0.2 * (-0.6 * g + (e2 - 0.6 * e1) * 0.1 * e1);
    const double C2 = 0.2 * (g + (e2 - 0.6 * e1) * 0.1 * e2);
    ASSERT_NEAR(s.residual[0], 0.0, 1e-12);
    ASSERT_NEAR(C2 * s.reaction_torque[0] - C1 * s.reaction_torque[1], 0.0, 1e-11);
    ASSERT_NEAR(s.reaction_torque[0], C1 * s.multiplier[0], 1e-11);
  }
  // Two iterations at each stage and node of a step, or nearly so.
  EXPECT_GT(simulation.statistics().newton_iterations, 10 * simulation.statistics().steps);
  EXPECT_LT(simulation.statistics().newton_iterations, 30 * simulation.statistics().steps);
}

// As DrivetrainState.msg says: C^T multiplier is the covariant rate of the reaction under
// `generalized_gauss`, and the reaction itself under `gauss`.
TEST(Principles, MultipliersAreThoseOfTheMessage) {
  const std::string scene =
      test::sceneText("crank, load 2",
                      {"motor on crank: 5-0.3*w1",
                       "variator = KinematicRatio, shafts: [crank, load], ratio: '0.6+0.1*sin(t)'"},
                      "crank: {inertia: {mean: 1.5, harmonics: [{order: 1, cos: 0.8}]}}\n"
                      "initial: {velocity: [5, 3]}");
  double difference = 0.0;
  for (const std::string principle : {"generalized_gauss", "gauss"}) {
    Simulation simulation(
        test::withTolerance(test::sceneFromText(scene + "principle: " + principle), 1e-11));
    for (int n = 1; n <= 20; ++n) {
      ASSERT_TRUE(simulation.advanceTo(0.1 * n).ok()) << simulation.describeStatus();
      const Sample& s = simulation.sample();
      const double J = 1.5 + 0.8 * std::cos(s.angle[0]);
      const double slope = -0.8 * std::sin(s.angle[0]);
      const double C[] = {-(0.6 + 0.1 * std::sin(s.time)), 1.0};
      const double covariant[] = {
          s.reaction_torque_rate[0] - slope / (2.0 * J) * s.reaction_torque[0] * s.velocity[0],
          s.reaction_torque_rate[1]};
      for (int i = 0; i < 2; ++i) {
        const double told = principle == "gauss" ? s.reaction_torque[i] : covariant[i];
        EXPECT_NEAR(C[i] * s.multiplier[0], told, 1e-9) << principle;
        difference =
            std::max(difference, std::abs(C[i] * s.multiplier[0] - s.reaction_torque_rate[i]));
      }
    }
    EXPECT_GT(std::exchange(difference, 0.0), 0.1) << principle;  // R' itself is something else
  }
}

// [18] on a constraint of order 3: R stays in range(C^T) while C eta + c0 = 0; the generalized
// principle on the same scene leaves that range, because R' = C^T Lambda is not (C^T lambda)'.
TEST(Principles, GaussOnOrder3IsEquation18) {
  Simulation formal =
      simulate({kOrder3, "{velocity: [5, 3], acceleration: [4, 2.75], project: true}", "gauss"});
  double off_range = 0.0;
  const Sample first = formal.sample();
  Simulation generalized = simulate({kOrder3, startWith(first)});
  for (int n = 0; n <= 20; ++n) {
    const double t = 0.25 * n;
    ASSERT_TRUE(formal.advanceTo(t).ok()) << formal.describeStatus();
    ASSERT_TRUE(generalized.advanceTo(t).ok());
    double C[2];
    calcRatioRow(t, C);
    const auto outside = [&](const Sample& s) {
      return C[1] * s.reaction_torque[0] - C[0] * s.reaction_torque[1];
    };
    EXPECT_NEAR(outside(formal.sample()), 0.0, 1e-11) << t;
    EXPECT_NEAR(formal.sample().residual[0], 0.0, 1e-11) << t;
    off_range = std::max(off_range, std::abs(outside(generalized.sample())));
  }
  EXPECT_GT(off_range, 0.1);
}

// The same physics through [17] (order 2, state without accelerations) and [18] (order 3).
TEST(Principles, GaussOfOrder2AndEquation18AgreeFromTheSameStart) {
  Simulation second = simulate({kOrder2, "{velocity: [5, 3]}", "gauss"});
  const Sample first = second.sample();
  Simulation third = simulate({kOrder3, startWith(first), "gauss"});
  expectSameMotion(second, third, 5.0, 1e-7);
}

TEST(Principles, Equation18RefusesAReactionOutOfRange) {
  test::expectRefused("initial/acceleration", {}, [&] { simulate({kOrder3, kStart, "gauss"}); });
}

// A jump of a torque is the limit of ever faster ramps, for a C that turns with the accelerations,
// too: R stays in the range of C^T, and C de = 0.
TEST(Principles, Equation18JumpsAsTheLimitOfRamps) {
  const auto runWith = [&](const std::string& torque) {
    Simulation simulation(test::withTolerance(
        test::sceneFromText("a 1, b 2",
                            {"q on a: " + torque + "-0.1*w1", "r on b: 1+0.5*cos(3*t)-0.2*w2",
                             "v of order 3: e1*j1+e2*j2"},
                            "principle: gauss\n"
                            "initial: {acceleration: [1.2, 1.6], project: true}"),
        1e-10));
    EXPECT_TRUE(simulation.advanceTo(1.0).ok()) << simulation.describeStatus();
    const Sample& s = simulation.sample();
    EXPECT_NEAR(s.acceleration[1] * s.reaction_torque[0], s.acceleration[0] * s.reaction_torque[1],
                1e-9);
    return s;
  };
  const Sample jump = runWith("if(t<0.5,2,1)");
  for (const double width : {1e-4, 1e-6}) {
    const std::string end = std::to_string(1.0 / width);
    const Sample ramp = runWith("2-clamp(" + end + "*(t-0.5),0,1)");
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(ramp.velocity[i], jump.velocity[i], width + 1e-9);
      EXPECT_NEAR(ramp.acceleration[i], jump.acceleration[i], width + 1e-9);
    }
  }
}

TEST(Principles, DifferOnlyWhereCVaries) {
  const char* const kConstant = "order: 2, expression: \"0.2*(e2-0.6*e1)+w2-0.6*w1+0.1*sin(t)\"";
  Simulation a = simulate({kConstant, "{velocity: [5, 3]}", "gauss"});
  Simulation b = simulate({kConstant, "{velocity: [5, 3]}", "generalized_gauss"});
  expectSameMotion(a, b, 5.0, 1e-7);

  Simulation c = simulate({kOrder1, "{velocity: [5, 3]}", "gauss"});
  Simulation d = simulate({kOrder1, "{velocity: [5, 3]}", "generalized_gauss"});
  c.advanceTo(5.0);
  d.advanceTo(5.0);
  EXPECT_GT(std::abs(c.sample().velocity[0] - d.sample().velocity[0]), 0.01);
}

TEST(Principles, GaussAsksATorqueForItsRate) {
  // |w1|^0.5 has no rate at rest, where the motion says so; it has one at any speed.
  Simulation rest = simulate({kOrder1, "{velocity: [0, 0]}", "gauss", "10-sqrt(abs(w1))"}, 1e-6);
  EXPECT_EQ(rest.advanceTo(1.0).reason, StopReason::kNonFiniteValue);
  Simulation slow =
      simulate({kOrder1, "{velocity: [1e-9, 6e-10]}", "gauss", "10-sqrt(abs(w1))"}, 1e-6);
  EXPECT_TRUE(slow.advanceTo(1.0).ok()) << slow.describeStatus();
}

// --- reversal, covariance ---------------------------------------------------------------------
TEST(TimeReversal, ASmoothSceneReturnsToItsStart) {
  const auto scene = [](const std::string& t, const std::string& sign, const std::string& start) {
    const std::string w1 = "(" + sign + "w1)";
    const std::string w2 = "(" + sign + "w2)";
    return Scene2{"order: 2, expression: \"0.5*(e2-(0.6+0.1*sin(" + t + "))*e1)*(1+0.01*e1^2)+" +
                      w2 + "-0.6*" + w1 + "+0.2*" + w1 + "*sin(" + t + ")\"",
                  start, "generalized_gauss", "3*sin(2*" + t + ")-0.2*" + w1};
  };
  // the propeller's -0.02 w2^2 is even in w2: it stays as it is
  Simulation forward = simulate(scene("t", "", "{velocity: [5, 3]}"), 1e-12);
  const Sample begin = forward.sample();
  ASSERT_TRUE(forward.advanceTo(2.0).ok());
  const Sample end = forward.sample();
  const std::string start =
      "{angle: " + test::list({end.angle[0], end.angle[1]}) +
      ", velocity: " + test::list({-end.velocity[0], -end.velocity[1]}) +
      ", acceleration: " + test::list({end.acceleration[0], end.acceleration[1]}) + "}";
  Simulation back = simulate(scene("(2-t)", "-", start), 1e-12);
  ASSERT_TRUE(back.advanceTo(2.0).ok()) << back.describeStatus();
  const Sample& returned = back.sample();
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(returned.angle[i], begin.angle[i], 1e-8);
    EXPECT_NEAR(returned.velocity[i], -begin.velocity[i], 1e-8);
    EXPECT_NEAR(returned.acceleration[i], begin.acceleration[i], 1e-8);
    EXPECT_NEAR(returned.reaction_torque[i], begin.reaction_torque[i], 1e-8);
  }
}

// A crank of inertia J = (a + b cos phi)^2 is a shaft of unit inertia in x = a phi + b sin phi. The
// motion may not depend on the coordinate, for either principle; the reaction is not zero and not
// in range(C^T), so that the connection Gamma counts.
TEST(Covariance, TheMotionDoesNotDependOnTheCoordinate) {
  const double a = 1.2;
  const double b = 0.5;
  // (a + b cos phi)^2 = a^2 + b^2/2 + 2 a b cos phi + b^2/2 cos 2 phi
  const std::string scene_phi = test::sceneText(
      "crank, load 2",
      {"motor on crank: (1.2+0.5*cos(phi1))*(2+sin(3*t)-0.2*(1.2+0.5*cos(phi1))*w1)",
       "drag on load: -0.3*w2",
       "variator: 0.3*(e2-0.7*((1.2+0.5*cos(phi1))*e1-0.5*sin(phi1)*w1^2))*(1+0.02*e2^2)"
       "+w2-0.7*(1.2+0.5*cos(phi1))*w1"},
      "crank: {inertia: {mean: 1.565, harmonics: [{order: 1, cos: 1.2}, {order: 2, cos: 0.125}]}}");
  const std::string scene_x = test::sceneText(
      "straight 1, load 2", {"motor on straight: 2+sin(3*t)-0.2*w1", "drag on load: -0.3*w2",
                             "variator: 0.3*(e2-0.7*e1)*(1+0.02*e2^2)+w2-0.7*w1"});
  for (const std::string principle : {"generalized_gauss", "gauss"}) {
    // at phi = 0: x' = (a + b) w, x'' = (a + b) e
    const bool is_given = principle != "gauss";
    const auto start = [&](const std::string& scene, double velocity,
                           const std::string& acceleration) {
      return test::withTolerance(
          test::sceneFromText(scene + "initial: {velocity: " + test::list({velocity, 1.5}) +
                              (is_given ? ", acceleration: " + acceleration : "") +
                              "}\nprinciple: " + principle),
          1e-12);
    };
    Simulation crank(start(scene_phi, 2.0, "[1, 0.5], project: true"));
    const Sample first = crank.sample();
    Simulation straight(
        start(scene_x, (a + b) * 2.0,
              test::list({(a + b) * first.acceleration[0], first.acceleration[1]})));
    for (double t : {0.3, 1.0, 2.5, 5.0}) {
      ASSERT_TRUE(crank.advanceTo(t).ok()) << crank.describeStatus();
      ASSERT_TRUE(straight.advanceTo(t).ok()) << straight.describeStatus();
      const Sample p = crank.sample();
      const Sample x = straight.sample();
      const double c = a + b * std::cos(p.angle[0]);
      EXPECT_NEAR(a * p.angle[0] + b * std::sin(p.angle[0]), x.angle[0], 1e-8) << principle;
      EXPECT_NEAR(c * p.velocity[0], x.velocity[0], 1e-8) << principle;
      EXPECT_NEAR(p.velocity[1], x.velocity[1], 1e-8) << principle;
      EXPECT_NEAR(p.acceleration[1], x.acceleration[1], 1e-8) << principle;
      // covectors: R_phi = R_x dx/dphi
      EXPECT_NEAR(p.reaction_torque[0], c * x.reaction_torque[0], 1e-8) << principle;
      EXPECT_NEAR(p.reaction_torque[1], x.reaction_torque[1], 1e-8) << principle;
      EXPECT_NEAR(p.reaction_torque_rate[0],
                  c * x.reaction_torque_rate[0] -
                      b * std::sin(p.angle[0]) * p.velocity[0] * x.reaction_torque[0],
                  1e-7)
          << principle;
    }
  }
}

}  // namespace
}  // namespace variator_sim
