// Events inside a step: pulses, jumps of laws, known instants; by every stepper, against motions
// known in closed form.

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;

constexpr StepperKind kSteppers[] = {
    StepperKind::kAuto, StepperKind::kDopri5, StepperKind::kFehlberg78,  StepperKind::kRadau,
    StepperKind::kRk4,  StepperKind::kTaylor, StepperKind::kTaylorFixed,
};
constexpr StepperKind kControlled[] = {StepperKind::kAuto, StepperKind::kDopri5,
                                       StepperKind::kFehlberg78, StepperKind::kRadau,
                                       StepperKind::kTaylor};
constexpr const char* kPrinciples[] = {"generalized_gauss", "gauss"};

std::string text(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  return buffer;
}

/// True if steps, of size kStep where fixed, resolve a pulse of this duration, s.
constexpr double kStep = 2e-4;
bool isMeantFor(StepperKind stepper, double duration) {
  return !isFixedStep(stepper) || duration > 10.0 * kStep;
}

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

/// Allowed loss: larger for fixed steps, which keep no tolerance, but less than a missed pulse.
double allowed(StepperKind stepper) {
  return isFixedStep(stepper) ? 1e-4 : 1e-7;
}

std::string label(StepperKind stepper, const std::string& what) {
  return std::string(toString(stepper)) + ", " + what;
}

// max(0, sin(z t) - c): narrow pulses between which nothing happens. Each gives the impulse
// (2 cos x - c (pi - 2 x)) / z with sin x = c, symmetric about its middle.
TEST(InsideOfAStep, PulsesOfTimeAreSeen) {
  for (const char* principle : kPrinciples) {
    for (StepperKind stepper : kSteppers) {
      for (double z : {3.0, 40.0, 400.0}) {
        for (double c : {0.9, 0.999, 0.999999}) {
          const double x = std::asin(c);
          const double duration = (kPi - 2.0 * x) / z;
          if (!isMeantFor(stepper, duration)) continue;
          // (Rounding of so steep a torque is all that the check of its integral sees: it may
          // stop.)
          if (stepper == StepperKind::kRadau && duration < 1e-5) continue;
          const double impulse = (2.0 * std::cos(x) - c * (kPi - 2.0 * x)) / z;
          const double size = 1.0 / impulse;  // each pulse changes the speed by 1
          Simulation simulation(freeShaft(
              text(size) + "*max(0,sin(" + text(z) + "*t)-" + text(c) + ")", stepper, principle));
          const int pulses = 5;
          const double end = 2.0 * kPi * pulses / z;
          ASSERT_TRUE(simulation.advanceTo(end).ok()) << simulation.describeStatus();
          double angle = 0.0;
          for (int n = 0; n < pulses; ++n) angle += end - (0.5 * kPi + 2.0 * kPi * n) / z;
          const std::string what =
              label(stepper, std::string(principle) + " z " + text(z) + " c " + text(c));
          EXPECT_NEAR(simulation.sample().velocity[0], pulses, 100.0 * allowed(stepper)) << what;
          EXPECT_NEAR(simulation.sample().angle[0], angle, 100.0 * allowed(stepper)) << what;
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

// The same of the angle: w^2/2 grows by the integral of the pulse over the angle.
TEST(InsideOfAStep, PulsesOfAngleAreSeen) {
  for (const char* principle : kPrinciples) {
    for (StepperKind stepper : kControlled) {
      for (double z : {1.0, 7.0, 30.0}) {
        for (double c : {0.9, 0.9999}) {
          const double x = std::asin(c);
          if (!isMeantFor(stepper, (kPi - 2.0 * x) / z / 10.0)) continue;
          const double work = (2.0 * std::cos(x) - c * (kPi - 2.0 * x)) / z;
          const double size = 0.5 / work;  // each pulse gives half a joule
          Simulation simulation(
              freeShaft(text(size) + "*max(0,sin(" + text(z) + "*phi1)-" + text(c) + ")", stepper,
                        principle, "10"));
          const double period = 2.0 * kPi / z;
          for (double time = 0.0; time < 3.0; time += 0.37) {
            ASSERT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
            const Sample& sample = simulation.sample();
            const double phase = std::fmod(sample.angle[0], period) / period;
            if (phase > 0.1 && phase < 0.4) continue;  // within a pulse, perhaps
            const double pulses = std::floor(sample.angle[0] / period) + (phase >= 0.4 ? 1 : 0);
            EXPECT_NEAR(sample.velocity[0] * sample.velocity[0], 100.0 + pulses,
                        (100.0 + pulses) * 10.0 * allowed(stepper))
                << label(stepper, std::string(principle) + " z " + text(z) + " c " + text(c));
          }
        }
      }
    }
  }
}

// A parabola of the time, and a speed, that dip below an edge for a moment: two crossings in one
// step. dw/dt = 1 - 2 t until t = 1 brings the speed back to 0 through 1/4 at t = 1/2.
TEST(InsideOfAStep, ATouchIsTold) {
  for (StepperKind stepper : kSteppers) {
    for (double depth : {1e-2, 1e-4, 1e-6}) {
      if (!isMeantFor(stepper, 2.0 * std::sqrt(depth))) continue;
      // the integral of max(0, d - (t - 3)^2) is 4/3 d^(3/2)
      const double impulse = 4.0 / 3.0 * depth * std::sqrt(depth);
      Simulation time(freeShaft(text(1.0 / impulse) + "*max(0," + text(depth) + "-(t-3)^2)",
                                stepper, "generalized_gauss"));
      ASSERT_TRUE(time.advanceTo(8.0).ok()) << time.describeStatus();
      EXPECT_NEAR(time.sample().velocity[0], 1.0, 10.0 * allowed(stepper)) << text(depth);

      // max(0, w - (1/4 - d)) accelerates another shaft: w = t - t^2 there
      Scene scene = test::sceneFromText(
          "a 1, b 1", {"p on a: 1-2*t",
                       "q on b: " + text(1.0 / impulse) + "*max(0,w1-(0.25-" + text(depth) + "))"});
      scene.solver.stepper = stepper;
      scene.solver.step = kStep;
      Simulation speed(scene);
      ASSERT_TRUE(speed.advanceTo(1.5).ok()) << speed.describeStatus();
      EXPECT_NEAR(speed.sample().velocity[1], 1.0, 100.0 * allowed(stepper))
          << label(stepper, text(depth));
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

// At rest beside an edge rounding decides the side. If the torque is the same on both, steps ignore
// the event: the motion alone limits their size. (Found in the field: one step was rejected 2,483
// times.)
TEST(InsideOfAStep, AtRestAnEdgeThatChangesNothingIsLeftAlone) {
  const std::string loss =
      "-(if(tanh(w1/wr) > 0, tanh(w1/wr)*max((0.75*(if(t < 0.5, 0, -0.5)) + 0.625)/0.625,"
      " (-3*(if(t < 0.5, 0, -0.5)) + 2.5)/2.5), -tanh(w1/wr)*min((0.75*(if(t < 0.5, 0, -0.5)) -"
      " 0.625)/0.625, (-3*(if(t < 0.5, 0, -0.5)) - 2.5)/2.5)))";
  for (const StepperKind stepper : {StepperKind::kAuto, StepperKind::kRadau}) {
    for (const char* principle : kPrinciples) {
      Scene scene = test::sceneFromText(
          "input 0.002",
          {"load on input: if(t < 0.5, 0, 1)", "loss = ExpressionTorque, shaft: input, torque: '" +
                                                   loss + "', parameters: {wr: 0.0001}"},
          std::string("initial: {velocity: [10]}\nprinciple: ") + principle);
      scene.solver.stepper = stepper;
      Simulation simulation(std::move(scene));
      ASSERT_TRUE(simulation.advanceTo(1.0).ok()) << label(stepper, principle);
      // The load and 1.6 tanh(w/wr) are in balance.
      EXPECT_NEAR(simulation.sample().velocity[0], 1e-4 * std::atanh(0.625), 1e-11)
          << label(stepper, principle);
      const Statistics& counts = simulation.statistics();
      EXPECT_LT(counts.steps + counts.rejected_steps, 600U) << label(stepper, principle);
    }
  }
}

// sign of the time and of a speed: the accelerations jump with the torque, and no reaction is left
// on a free shaft.
TEST(JumpsOfLaws, MoveTheAccelerations) {
  for (const char* principle : kPrinciples) {
    for (StepperKind stepper : kControlled) {
      Simulation time(freeShaft("sign(t-1)", stepper, principle, "1"));
      ASSERT_TRUE(time.advanceTo(3.0).ok()) << time.describeStatus();
      EXPECT_NEAR(time.sample().velocity[0], 2.0, allowed(stepper)) << toString(stepper);
      EXPECT_NEAR(time.sample().acceleration[0], 1.0, allowed(stepper));
      EXPECT_NEAR(time.sample().reaction_torque[0], 0.0, allowed(stepper));

      // (Implicit steps meet a jump of a speed under gauss with a Jacobian across it: they may
      // stop.)
      const bool is_implicit = stepper == StepperKind::kRadau;
      if (is_implicit && principle == std::string("gauss")) continue;
      // braked from 2 rad/s by 15 N m, driven back by 5
      Simulation speed(freeShaft("-10-5*sign(w1)", stepper, principle, "2"));
      ASSERT_TRUE(speed.advanceTo(1.0).ok()) << speed.describeStatus();
      EXPECT_NEAR(speed.sample().velocity[0], -13.0 / 3.0, 10.0 * allowed(stepper));
      EXPECT_NEAR(speed.sample().reaction_torque[0], 0.0, allowed(stepper)) << toString(stepper);

      // a square wave: back and forth
      Simulation square(freeShaft("sign(sin(pi*t))", stepper, principle));
      ASSERT_TRUE(square.advanceTo(7.0).ok()) << square.describeStatus();
      EXPECT_NEAR(square.sample().velocity[0], 1.0, 10.0 * allowed(stepper)) << toString(stepper);
    }
  }
}

// A jump of the torque on a constraint that is nonlinear in the accelerations does what a command
// of the same size does at the same instant.
TEST(JumpsOfLaws, DoWhatCommandsDo) {
  const std::string rest =
      "constraints: [k]\n"
      "k: {type: variator_sim/ExpressionConstraint, order: 2,\n"
      "    expression: \"0.2*(e2-0.6*e1)*(1+0.05*(e1^2+e2^2))+w2-0.6*w1\"}\n"
      "initial: {velocity: [3, 1]}\n";
  const std::string shafts = test::sceneText("a 0.8, b 2", {});
  Simulation law(test::sceneFromText(
      shafts +
      "torques: [q]\n"
      "q: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"2+6*sign(t-0.7)\"}\n" +
      rest));
  Simulation command(test::sceneFromText(
      shafts +
      "torques: [c]\n"
      "c: {type: variator_sim/CommandedTorque, shaft: a, topic: u, initial: -4}\n" +
      rest));
  command.advanceTo(0.7);
  command.command(0, 8.0);
  ASSERT_TRUE(law.advanceTo(1.3).ok()) << law.describeStatus();
  ASSERT_TRUE(command.advanceTo(1.3).ok()) << command.describeStatus();
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(law.sample().velocity[i], command.sample().velocity[i], 1e-8);
    EXPECT_NEAR(law.sample().acceleration[i], command.sample().acceleration[i], 1e-7);
    EXPECT_NEAR(law.sample().reaction_torque[i], command.sample().reaction_torque[i], 1e-7);
  }
}

// A motion that crosses back at once cannot continue; the stop comes at once and names the law.
TEST(JumpsOfLaws, CrossedBackAtOnceIsChattering) {
  for (const char* principle : kPrinciples) {
    for (StepperKind stepper : kControlled) {
      for (double drive : {0.0, 1.0, -4.9}) {
        Simulation stuck(freeShaft(text(drive) + "-5*sign(w1)", stepper, principle, "2"));
        const MotionStatus& status = stuck.advanceTo(10.0);
        EXPECT_EQ(status.reason, StopReason::kChattering)
            << label(stepper, text(drive)) << " " << stuck.describeStatus();
        EXPECT_NEAR(status.time, 2.0 / (5.0 - drive), 1e-3);
        EXPECT_NE(stuck.describeStatus().find("torque 'q'"), std::string::npos);
        EXPECT_LT(stuck.statistics().steps + stuck.statistics().rejected_steps, 5000u);
      }
    }
  }
  Simulation jerk(test::sceneFromText("a 1, b 2", {"v of order 3: j2-5*sign(1-e2)"},
                                      "initial: {acceleration: [0, 0]}"));
  EXPECT_EQ(jerk.advanceTo(10.0).reason, StopReason::kChattering) << jerk.describeStatus();
  EXPECT_NEAR(jerk.time(), 0.2, 1e-6);  // the last good state lies a little before the edge
  EXPECT_NE(jerk.describeStatus().find("constraint 'v'"), std::string::npos);
}

// A constraint itself may not jump: there is no motion to the other side.
TEST(JumpsOfLaws, AConstraintThatJumpsStops) {
  for (const char* formula : {"e2-0.5*e1-0.3*sign(t-1)", "e2-0.5*e1+w2-0.5*w1-sign(w1-1)"}) {
    Simulation simulation(
        test::sceneFromText("a 1, b 2", {"q on a: 2-0.1*w1", std::string("v: ") + formula}));
    EXPECT_EQ(simulation.advanceTo(10.0).reason, StopReason::kJumpFailed)
        << simulation.describeStatus();
    EXPECT_NE(simulation.describeStatus().find("constraint 'v'"), std::string::npos);
    EXPECT_LT(simulation.time(), 5.0);
  }
}

// f with a kink, order 1: f' = 0 moves the accelerations, and both principles agree where C keeps
// its direction in the long run: the reaction jumps along C.
TEST(KinksOfOrder1, MoveTheAccelerations) {
  for (StepperKind stepper : kControlled) {
    double velocity[2][2];
    for (int p = 0; p < 2; ++p) {
      Scene scene = test::sceneFromText(
          "a 1, b 2", {"q on a: 3*sin(2*t)-0.1*w1", "v of order 1: w2-0.5*w1-0.1*abs(t-1)"},
          "initial: {velocity: [1, 0.6]}\nprinciple: " + std::string(kPrinciples[p]));
      scene.solver.stepper = stepper;
      Simulation simulation(scene);
      ASSERT_TRUE(simulation.advanceTo(2.5).ok())
          << label(stepper, kPrinciples[p]) << simulation.describeStatus();
      for (int i = 0; i < 2; ++i) velocity[p][i] = simulation.sample().velocity[i];
    }
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(velocity[0][i], velocity[1][i], allowed(stepper)) << toString(stepper);
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

// f with a bend in a velocity: C = (-g, 1) turns from g = 1/2 to 4/5, with e2 = g e1. Under gauss
// the reaction is least on both sides; else J de = C' L and C de = e1 dg, by which J1 e1^2 + J2
// e2^2 stays. A motion that begins at rest on a bend is at once behind it.
TEST(KinksOfOrder1, TurnWithASpeed) {
  const double J1 = 1.0;
  const double J2 = 2.0;
  const double Q = 3.0;
  const auto inertia = [&](double g) { return J1 + g * g * J2; };
  const char* const kBends[] = {"w2-0.5*w1-0.3*max(0,w1-1.2)", "w2-0.65*w1-0.15*abs(w1-1.2)+0.18",
                                "w2-if(w1<1.2,0.5*w1,0.6+0.8*(w1-1.2))", "w2-curve(w1)"};
  for (int p = 0; p < 2; ++p) {
    for (const char* bend : kBends) {
      Simulation simulation(test::sceneFromText(
          "a 1, b 2", {"q on a: 3", std::string("v of order 1: ") + bend},
          std::string("principle: ") + kPrinciples[p] +
              "\ninitial: {velocity: [1, 0.5]}\ntables: [curve]\n"
              "curve: {x: [-2, 1.2, 3.2], values: [-1, 0.6, 2.2], interpolation: linear}\n"));
      ASSERT_TRUE(simulation.advanceTo(1.0).ok()) << bend << simulation.describeStatus();
      const double before = Q / inertia(0.5);
      const double after =
          p == 1 ? Q / inertia(0.8) : before * std::sqrt(inertia(0.5) / inertia(0.8));
      const double passed = 0.2 / before;
      const Sample& s = simulation.sample();
      EXPECT_NEAR(s.acceleration[0], after, 1e-8) << kPrinciples[p] << bend;
      EXPECT_NEAR(s.acceleration[1], 0.8 * after, 1e-8) << kPrinciples[p] << bend;
      EXPECT_NEAR(s.velocity[0], 1.2 + after * (1.0 - passed), 1e-8) << kPrinciples[p] << bend;
    }
    Simulation rest(test::sceneFromText("a 1, b 2",
                                        {"q on a: 3", "v of order 1: w2-0.5*w1-0.3*abs(w1)"},
                                        std::string("principle: ") + kPrinciples[p]));
    ASSERT_TRUE(rest.advanceTo(1.0).ok()) << rest.describeStatus();
    EXPECT_NEAR(rest.sample().velocity[0],
                p == 1 ? Q / inertia(0.8) : Q / std::sqrt(inertia(0.5) * inertia(0.8)), 1e-8);
  }
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

// The accelerations of least reaction would stay in a corner for a while.
TEST(CornersOfPsi, AreRefusedUnderGauss) {
  try {
    Simulation(
        test::sceneFromText("a 1.5, b 0.8", {"v: e2-0.4*e1+0.02*abs(e1+0.5)"}, "principle: gauss"));
    ADD_FAILURE() << "accepted";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.keyPath(), "v");
    EXPECT_NE(error.message().find("sqrt(x^2+1e-12) for abs(x)"), std::string::npos);
  }
}

/// A depth below the angle of 1 rad that no formula tells.
class Depth : public OpaqueFunction {
 public:
  Depth() : OpaqueFunction(1) {}
  double value(const double* x) const override { return x[0] - 1.0; }
  void calcGradient(const double* /*x*/, double* gradient) const override { gradient[0] = 1.0; }
};

/// A spring that is met at an angle; what it switches by is an opaque function.
class Stop : public Torque {
 public:
  explicit Stop(bool jumps) : jumps_(jumps) {}

 private:
  void build(LawContext& scene) override {
    const Shaft shaft = scene.shaftAt(0);
    const Expression depth = scene.function(std::make_shared<Depth>(), {shaft.angle});
    scene.apply(shaft, -where(depth < 0.0, 0.0, jumps_ ? Expression(4.0) : 100.0 * depth));
  }
  bool jumps_;
};

// An opaque switching function: met and left within one step, with a kink and with a jump.
TEST(SwitchesOfPlugins, AreSeenInsideAStep) {
  for (const char* principle : kPrinciples) {
    for (StepperKind stepper : kControlled) {
      for (bool jumps : {false, true}) {
        const bool is_implicit = stepper == StepperKind::kRadau;
        if (jumps && is_implicit && principle == std::string("gauss")) continue;  // as above
        if (stepper == StepperKind::kTaylor) continue;                            // needs formulas
        Scene scene = freeShaft("0*t", stepper, principle, "1");
        test::addTorque(scene, std::make_shared<Stop>(jumps));
        Simulation simulation(std::move(scene));
        ASSERT_TRUE(simulation.advanceTo(3.0).ok())
            << label(stepper, principle) << simulation.describeStatus();
        // It enters at t = 1 with 1 rad/s and leaves with -1: after half a period of 10 rad/s, or
        // after 1/2 s under -4 N m.
        const double inside = jumps ? 0.5 : kPi / 10.0;
        EXPECT_NEAR(simulation.sample().velocity[0], -1.0, 10.0 * allowed(stepper))
            << label(stepper, principle) << jumps;
        EXPECT_NEAR(simulation.sample().angle[0], 1.0 - (2.0 - inside), 10.0 * allowed(stepper))
            << label(stepper, principle) << jumps;
      }
    }
  }
}

// From rest, where nothing tells of it: an imposed jerk, tables over time; both of their ends are
// known instants.
TEST(KnownInstants, EndSteps) {
  for (StepperKind stepper : kSteppers) {
    for (double start : {0.3, 3.3, 17.1}) {
      for (double duration : {0.01, 0.4, 2.3}) {
        Scene scene = test::sceneFromText(
            "a 1, b 1", {"j = ImposedJerk, shaft: a, velocity_change: 20, duration: " +
                         text(duration) + ", start: " + text(start)});
        scene.solver.stepper = stepper;
        scene.solver.step = 0.001;
        if (isFixedStep(stepper) && duration <= 10.0 * scene.solver.step) continue;
        Simulation simulation(scene);
        ASSERT_TRUE(simulation.advanceTo(20.0).ok()) << simulation.describeStatus();
        EXPECT_NEAR(simulation.sample().velocity[0], 20.0, 200.0 * allowed(stepper))
            << label(stepper, text(start) + " " + text(duration));
      }
    }
  }
  // A pulse in a table of jerks: two quintics of the widths w, level at their outer ends, whose
  // second derivative at the peak is the least of theirs, -20/w^2 (table.h): their integral is
  // 10 w - w/3.
  for (double width : {0.001, 0.1, 0.7}) {
    Simulation simulation(test::sceneFromText(
        "a 1, b 1", {"j = ImposedJerk, shaft: a, jerk: {times: [5, " + text(5.0 + width) + ", " +
                     text(5.0 + 2.0 * width) + "], values: [0, 10, 0]}"}));
    ASSERT_TRUE(simulation.advanceTo(8.0).ok()) << simulation.describeStatus();
    EXPECT_NEAR(simulation.sample().acceleration[0], 29.0 / 3.0 * width, 1e-8) << width;
  }
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
      "shafts: [drive, load]\ndrive: {inertia: 0.5}\nload: {inertia: 1.2}\n"
      "torques: [motor, drag, pulse]\n"
      "motor: {type: variator_sim/ExpressionTorque, shaft: drive, torque: \"8*(1-w1/40)\"}\n"
      "drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: \"-0.1*w2\"}\npulse: " +
      pulse +
      "\nconstraints: [k]\nk: {type: variator_sim/ExpressionConstraint, order: 2, expression: "
      "\"0.5*(e2-0.8*e1)+0.01*(e1^2+e1*e2)+w2-0.8*w1\"}\n"
      "initial: {velocity: [10, 8]}\nprinciple: gauss\nsolver: {stepper: " +
      std::string(stepper) + "}\n"));
}
std::string pulseOf(const std::string& torque) {
  return "{type: variator_sim/ExpressionTorque, shaft: drive, torque: \"" + torque + "\"}";
}

TEST(TorquesThatJump, LeadLeastReactionsWhereRampsDo) {
  for (const int size : {3, 8, -6}) {
    const std::string height = std::to_string(size);
    Simulation ramp = curvedRatio(pulseOf(height + "*clamp((t-1)/1e-5, 0, 1)"), "fehlberg78");
    ASSERT_TRUE(ramp.advanceTo(1.2).ok()) << ramp.describeStatus();
    for (const char* stepper : {"auto", "dopri5", "radau", "taylor"}) {
      SCOPED_TRACE(height + " N m by " + stepper);
      Simulation formula = curvedRatio(pulseOf("if(t < 1, 0, " + height + ")"), stepper);
      ASSERT_TRUE(formula.advanceTo(1.2).ok()) << formula.describeStatus();
      Simulation command =
          curvedRatio("{type: variator_sim/CommandedTorque, shaft: drive, topic: p}", stepper);
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

// --- implicit steps ------------------------------------------------------------------------------

/// A peak that drives a shaft on within 2e-4 rad/s of its speed: an implicit step that is much too
/// long would hold the shaft fast there, and its estimate show nothing.
TEST(ImplicitSteps, PassANarrowPeakThatDrives) {
  const Scene plain = test::sceneFromText(
      "a 1.5", {"m = MotorCurve, shaft: a, characteristic: table, table: {speed: [1.2999, 1.3, "
                "1.3001], torque: [0, 0.5, 0], beyond: constant}",
                "q on a: 1"});
  for (const double tolerance : {1e-3, 1e-4, 1e-6}) {
    SCOPED_TRACE("at " + std::to_string(tolerance));
    Simulation simulation(
        test::withTolerance(test::withStepper(plain, StepperKind::kRadau), tolerance));
    ASSERT_TRUE(simulation.advanceTo(3.0).ok()) << simulation.describeStatus();
    EXPECT_NEAR(simulation.sample().velocity[0], 2.0, 1e-4 + 10.0 * tolerance);
    EXPECT_NEAR(simulation.sample().acceleration[0], 1.0 / 1.5, 10.0 * tolerance);
  }
}

/// A torque that jumps at an angle throws the shaft back. A Jacobian by differences looks behind
/// the jump on either side, which is no stage that lay there.
TEST(ImplicitSteps, PassATorqueThatJumps) {
  const Scene plain = test::sceneFromText("a 1", {"s on a: if(phi1 > 0.6180339, -200, 0)"},
                                          "principle: gauss\ninitial: {velocity: [1]}");
  for (const StepperKind stepper : {StepperKind::kAuto, StepperKind::kRadau}) {
    for (const double tolerance : {1e-3, 1e-6, 1e-9}) {
      SCOPED_TRACE(std::string(toString(stepper)) + " at " + std::to_string(tolerance));
      Simulation simulation(test::withTolerance(test::withStepper(plain, stepper), tolerance));
      ASSERT_TRUE(simulation.advanceTo(2.5).ok()) << simulation.describeStatus();
      // In the stop for 2/200 s.
      EXPECT_NEAR(simulation.sample().velocity[0], -1.0, 100.0 * tolerance);
      EXPECT_NEAR(simulation.sample().angle[0], 0.6180339 - (2.5 - 0.6180339 - 0.01),
                  100.0 * tolerance);
    }
  }
}

/// The series over an edge ends a little behind it, and a hard stop turns the velocity there within
/// less than that: what it does to it is no part of a step's error.
TEST(ImplicitSteps, LoseNothingBehindAJump) {
  const double stiffness = 2000.0;
  for (int i = 0; i < 12; ++i) {
    const double at = 0.3 + 0.0637 * i + 0.0031 * i * i;
    SCOPED_TRACE("at " + std::to_string(at));
    constexpr double tolerance = 1e-11;
    const Scene plain = test::sceneFromText(
        "a 1", {"s on a: if(phi1 > " + text(at) + ", -" + text(stiffness) + ", 0)"},
        "principle: gauss\ninitial: {velocity: [1]}");
    Simulation simulation(
        test::withTolerance(test::withStepper(plain, StepperKind::kRadau), tolerance));
    ASSERT_TRUE(simulation.advanceTo(2.5).ok()) << simulation.describeStatus();
    EXPECT_NEAR(simulation.sample().velocity[0], -1.0, 30.0 * tolerance);
    EXPECT_NEAR(simulation.sample().angle[0], at - (2.5 - at - 2.0 / stiffness), 30.0 * tolerance);
  }
}

/// Friction that holds a shaft in a layer of 1e-4 rad/s, stronger than what drives it: an error of
/// the velocity that a loose tolerance allows is wider than that, but what it makes of the torque
/// would stay as a torque of its own, and drive the shaft out of the layer.
TEST(ImplicitSteps, StayInANarrowLayerOfFriction) {
  const Scene plain = test::sceneFromText(
      "a 1.5, b 0.8",
      {"m on a: 2*cos(3*t)", "f = Friction, shaft: a, coulomb: 10, regularization_speed: 1e-4",
       "k: e2-0.5*e1"},
      "initial: {velocity: [1, 0.5]}");
  Simulation simulation(test::withTolerance(test::withStepper(plain, StepperKind::kRadau), 1e-3));
  for (int n = 1; n <= 9; ++n) {
    ASSERT_TRUE(simulation.advanceTo(4.0 / 9.0 * n).ok()) << simulation.describeStatus();
    const Sample& sample = simulation.sample();
    EXPECT_NEAR(sample.velocity[0], 0.0, 1e-4) << n;
    EXPECT_NEAR(sample.acceleration[0], 0.0, 0.01) << n;
    EXPECT_NEAR(sample.reaction_torque[0] + 0.5 * sample.reaction_torque[1], 0.0, 1.0) << n;
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
