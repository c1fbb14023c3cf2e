// Events inside a step: pulses and jumps of laws, against motions known in closed form.
// (test/known_motions.yaml has more of them, test/stress/pulses_test.cpp and law_jumps_test.cpp
// those of steps that keep a tolerance.)

#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::plainly;

constexpr double kPi = 3.14159265358979323846;

constexpr StepperKind kFixed[] = {StepperKind::kRk4, StepperKind::kTaylorFixed};
constexpr StepperKind kControlled[] = {StepperKind::kAuto, StepperKind::kDopri5,
                                       StepperKind::kFehlberg78, StepperKind::kRadau,
                                       StepperKind::kTaylor};
constexpr const char* kPrinciples[] = {"generalized_gauss", "gauss"};

/// Fixed steps, s, resolve pulses of ten of them.
constexpr double kStep = 2e-4;
constexpr double kResolved = 10.0 * kStep;

/// One free shaft of unit inertia under a formula.
Scene freeShaft(const std::string& torque, StepperKind stepper, const std::string& principle,
                const std::string& velocity = "0", double step = kStep) {
  Scene scene = test::sceneFromText(
      "a 1", {std::string("q on a: ") + torque},
      std::string("principle: ") + principle + "\ninitial: {velocity: [" + velocity + "]}");
  scene.solver.stepper = stepper;
  scene.solver.step = step;
  return scene;
}

/// Allowed loss of fixed steps, which keep no tolerance: less than a missed pulse.
constexpr double kLoss = 1e-4;

std::string label(StepperKind stepper, const std::string& what) {
  return std::string(toString(stepper)) + ", " + what;
}

// max(0, sin(z t) - c): narrow pulses between which nothing happens. Each gives the impulse
// (2 cos x - c (pi - 2 x)) / z with sin x = c, symmetric about its middle.
TEST(InsideOfAFixedStep, PulsesOfTimeAreSeen) {
  for (const char* principle : kPrinciples) {
    for (StepperKind stepper : kFixed) {
      for (double z : {3.0, 40.0, 400.0}) {
        for (double c : {0.9, 0.999, 0.999999}) {
          const double x = std::asin(c);
          const double duration = (kPi - 2.0 * x) / z;
          if (duration <= kResolved) continue;
          const double impulse = (2.0 * std::cos(x) - c * (kPi - 2.0 * x)) / z;
          const double size = 1.0 / impulse;  // each pulse changes the speed by 1
          Simulation simulation(
              freeShaft(plainly(size) + "*max(0,sin(" + plainly(z) + "*t)-" + plainly(c) + ")",
                        stepper, principle));
          const int pulses = 5;
          const double end = 2.0 * kPi * pulses / z;
          ASSERT_TRUE(simulation.advanceTo(end).ok()) << simulation.describeStatus();
          double angle = 0.0;
          for (int n = 0; n < pulses; ++n) angle += end - (0.5 * kPi + 2.0 * kPi * n) / z;
          const std::string what =
              label(stepper, std::string(principle) + " z " + plainly(z) + " c " + plainly(c));
          EXPECT_NEAR(simulation.sample().velocity[0], pulses, 100.0 * kLoss) << what;
          EXPECT_NEAR(simulation.sample().angle[0], angle, 100.0 * kLoss) << what;
        }
      }
    }
  }
}

// A pulse that is narrower than a step, read by a comparison or a kink alone: where it is 0 to all
// digits its series tells nothing of it. Impulses are sums over a fine grid.
TEST(InsideOfAStep, PulsesInComparisonsAreSeen) {
  struct Case {
    const char* pulse;
    double (*value)(double t);
  };
  const Case pulses[] = {
      {"exp(-((t-0.82)/1e-3)^2)",
       [](double t) { return std::exp(-1e6 * (t - 0.82) * (t - 0.82)); }},
      {"1/(1+((t-0.82)/1e-3)^2)",
       [](double t) { return 1.0 / (1.0 + 1e6 * (t - 0.82) * (t - 0.82)); }},
      {"cos(t-0.82)^1000000", [](double t) { return std::pow(std::cos(t - 0.82), 1e6); }},
      {"(-cos(t-0.82))^1000000", [](double t) { return std::pow(std::cos(t - 0.82), 1e6); }},
  };
  const std::pair<std::string, double (*)(double)> laws[] = {
      {"if(P > 0.773, 1000, 0)", [](double x) { return x > 0.773 ? 1000.0 : 0.0; }},
      {"1000*max(0, P - 0.773)", [](double x) { return 1000.0 * std::max(0.0, x - 0.773); }},
      {"1000*min(P, 0.3)", [](double x) { return 1000.0 * std::min(x, 0.3); }},
  };
  for (const Case& pulse : pulses) {
    for (const auto& [law, value] : laws) {
      double impulse = 0.0;
      const double h = 1e-7;
      for (int n = 0; n < 10000000; ++n) impulse += h * value(pulse.value(h * (n + 0.5)));
      std::string torque = law;
      torque.replace(torque.find('P'), 1, std::string("(") + pulse.pulse + ")");
      for (const StepperKind stepper : kControlled) {
        for (const char* principle : kPrinciples) {
          Simulation simulation(freeShaft(torque, stepper, principle));
          const std::string what = label(stepper, torque) + ", " + principle;
          ASSERT_TRUE(simulation.advanceTo(1.0).ok()) << what << simulation.describeStatus();
          EXPECT_NEAR(simulation.sample().velocity[0], impulse, 1e-4) << what;
        }
      }
    }
  }
}

// Even powers of a negative number rise to peaks, too: each turn of the shaft passes two.
TEST(InsideOfAStep, PeaksOfAnglesAreCounted) {
  for (const char* power : {"4000", "40000"}) {
    for (const StepperKind stepper : kControlled) {
      Scene scene = test::sceneFromText(
          "a 1", {"q on a: 5 - 0.5*w_a"},
          std::string(
              "variables: [n]\nn: {initial: 0}\nevents: [mark]\nmark: {when: \"cos(phi_a/2)^") +
              power + " - 0.5\", direction: rising, set: {n: \"n + 1\"}}\n");
      scene.solver.stepper = stepper;
      Simulation simulation(scene);
      ASSERT_TRUE(simulation.advanceTo(60.0).ok()) << simulation.describeStatus();
      // phi = 10 t - 20 (1 - exp(-t/2)) = 580: peaks at 2 pi k up to 92; the first is the start.
      EXPECT_EQ(simulation.operatingPoint().input[0], 92.0) << label(stepper, power);
    }
  }
}

// A parabola of the time, and a speed, that dip below an edge for a moment: two crossings in one
// step. dw/dt = 1 - 2 t until t = 1 brings the speed back to 0 through 1/4 at t = 1/2.
TEST(InsideOfAFixedStep, ATouchIsTold) {
  for (StepperKind stepper : kFixed) {
    for (double depth : {1e-2, 1e-4, 1e-6}) {
      if (2.0 * std::sqrt(depth) <= kResolved) continue;
      // the integral of max(0, d - (t - 3)^2) is 4/3 d^(3/2)
      const double impulse = 4.0 / 3.0 * depth * std::sqrt(depth);
      Simulation time(freeShaft(plainly(1.0 / impulse) + "*max(0," + plainly(depth) + "-(t-3)^2)",
                                stepper, "generalized_gauss"));
      ASSERT_TRUE(time.advanceTo(8.0).ok()) << time.describeStatus();
      EXPECT_NEAR(time.sample().velocity[0], 1.0, 10.0 * kLoss) << plainly(depth);

      // max(0, w - (1/4 - d)) accelerates another shaft: w = t - t^2 there
      Scene scene = test::sceneFromText(
          "a 1, b 1", {"p on a: 1-2*t", "q on b: " + plainly(1.0 / impulse) + "*max(0,w1-(0.25-" +
                                            plainly(depth) + "))"});
      scene.solver.stepper = stepper;
      scene.solver.step = kStep;
      Simulation speed(scene);
      ASSERT_TRUE(speed.advanceTo(1.5).ok()) << speed.describeStatus();
      EXPECT_NEAR(speed.sample().velocity[1], 1.0, 100.0 * kLoss) << label(stepper, plainly(depth));
    }
  }
}

// A speed that settles where a law has a kink, and an input that settles on that of a clamp
// and on a point of a table: nothing is crossed, so no step is made again.
TEST(InsideOfAStep, WhatSettlesOnAnEdgeIsNotSearched) {
  const char* const kLaws[] = {"5*clamp(u,0,1)-2*w1-abs(w1-2.5)", "5*curve(u)-2*w1-max(w1-2.5,0)"};
  for (const char* law : kLaws) {
    for (StepperKind stepper : {StepperKind::kDopri5, StepperKind::kFehlberg78, StepperKind::kRadau,
                                StepperKind::kTaylor}) {
      Scene scene = test::sceneFromText(
          "a 1", {"q on a: " + std::string(law)},
          "inputs: [u]\ntables: [curve]\nu: {topic: u, hold: first_order_lag, time_constant: "
          "0.2}\ncurve: {x: [0, 0.4, 1, 2], values: [0, 0.3, 1, 5]}");
      scene.solver.stepper = stepper;
      scene.solver.sleep = false;
      Simulation simulation(scene);
      simulation.advanceTo(0.5);
      simulation.command(0, 1.0);
      ASSERT_TRUE(simulation.advanceTo(60.0).ok()) << simulation.describeStatus();
      EXPECT_NEAR(simulation.sample().velocity[0], 2.5, 1e-6) << label(stepper, law);
      EXPECT_LE(simulation.statistics().rejected_steps, 100U) << label(stepper, law);
    }
  }
}

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

/// A torque that jumps in time: a sample at that very instant is of one side altogether, of the one
/// behind, as with commands.
TEST(TorquesThatJump, AreSampledOnOneSide) {
  for (const char* principle : kPrinciples) {
    for (const char* stepper : {"auto", "dopri5", "radau", "taylor"}) {
      SCOPED_TRACE(std::string(principle) + " " + stepper);
      Simulation simulation(test::sceneFromText(
          "drive 0.5, load 1.2",
          {"s on drive: 5 + if(t < 1, 0, 3)", "d on load: -0.1*w2", "k: 0.5*(e2-0.8*e1)+w2-0.8*w1"},
          std::string("initial: {velocity: [10, 8]}\nprinciple: ") + principle +
              "\nsolver: {stepper: " + stepper + "}"));
      ASSERT_TRUE(simulation.advanceTo(1.0).ok());
      const Sample at = simulation.sample();
      ASSERT_TRUE(simulation.advanceTo(1.0 + 1e-9).ok());
      const Sample& behind = simulation.sample();
      EXPECT_NEAR(at.applied_torque[0], 8.0, 1e-12);
      for (int i = 0; i < 2; ++i) {
        EXPECT_NEAR(at.acceleration[i], behind.acceleration[i], 1e-7) << i;
        EXPECT_NEAR(at.reaction_torque[i], behind.reaction_torque[i], 1e-7) << i;
      }
    }
  }
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
