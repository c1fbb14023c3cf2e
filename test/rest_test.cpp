// Sleeping at rest: when it begins, what samples are while it lasts, and everything that ends it or
// forbids it.
#include "rest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <utility>

#include "support/scenes.h"

namespace variator_sim {
namespace {

// --- the watch --------------------------------------------------------------------------------
TEST(RestWatch, ARateOfZeroIsRestAtOnce) {
  RestWatch watch;
  watch.reset();
  EXPECT_TRUE(watch.noteStep(0.0, 0.0));
}

/// What is left, |rate| / decay, when the watch says that a rate start * exp(-decay t) is rest; -1
/// when it never does.
double leftAtRest(double start, double decay, double step, int steps) {
  RestWatch watch;
  watch.reset();
  for (int n = 0; n < steps; ++n) {
    const double rate = start * std::exp(-decay * step * n);
    if (watch.noteStep(step * n, rate)) return rate / decay;
  }
  return -1.0;
}

// The integral of an exponential's tail is known: rate / decay.
TEST(RestWatch, ADecayIsRestWhenATenthOfTheToleranceIsLeft) {
  for (double decay : {1e-3, 1.0, 1e3}) {
    for (double start : {1.0, 1e3, 1e9}) {
      const double left = leftAtRest(start, decay, 0.1 / decay, 100000);
      ASSERT_GE(left, 0.0) << decay << ", " << start;
      EXPECT_LE(left, RestWatch::kLeft) << decay << ", " << start;
      // not later than a few falls after that
      if (start / decay > 1.0) {
        EXPECT_GT(left, RestWatch::kLeft / 1000.0) << decay << ", " << start;
      }
    }
  }
}

TEST(RestWatch, SlowRatesAreNotRestForBeingSmall) {
  // 1e-6 of the tolerance per second, but it goes on for ever
  RestWatch watch;
  watch.reset();
  for (int n = 0; n < 10000; ++n) ASSERT_FALSE(watch.noteStep(1.0 * n, 1e-6)) << n;
  // and a decay over 1e9 s has all of 1e3 tolerances left
  EXPECT_EQ(leftAtRest(1e-6, 1e-9, 1e3, 10000), -1.0);
}

TEST(RestWatch, AGrowingRateBeginsAnew) {
  RestWatch watch;
  watch.reset();
  for (int n = 0; n < 100; ++n) {
    ASSERT_FALSE(watch.noteStep(0.01 * n, 1e-9 * std::exp(0.01 * n))) << n;
  }
}

// The rate of an oscillation of 1e-3 rad/s falls to a thousandth where the acceleration passes
// through zero, and is back within a minute.
TEST(RestWatch, AMomentsLowIsNotRest) {
  for (double amplitude : {1e4, 500.0}) {  // of the velocity, in tolerances
    for (double step : {0.25, 1.0, 4.0, 16.0, 64.0}) {
      RestWatch watch;
      watch.reset();
      for (int n = 0; step * n < 20000.0; ++n) {
        const double angle = 1e-3 * step * n;
        const double rate = amplitude * 1e-3 *
                            std::max(std::abs(std::cos(angle)), 1e-3 * std::abs(std::sin(angle)));
        ASSERT_FALSE(watch.noteStep(step * n, rate)) << "step " << step << ", " << n;
      }
    }
  }
}

// A stiff coupling settles within 1e-5 s, and the shafts go on accelerating.
TEST(RestWatch, ASlowMotionAfterAFastTransientIsNotRest) {
  RestWatch watch(1.0);
  watch.reset();
  for (int n = 0; n < 10000; ++n) {
    const double t = 1e-6 * n;
    ASSERT_FALSE(watch.noteStep(t, 5e3 + 1e9 * std::exp(-3e5 * t))) << t;
  }
}

TEST(RestWatch, ResetForgets) {
  const auto rate = [](int n) { return 10.0 * std::exp(-0.3 * n); };
  RestWatch watch;
  watch.reset();
  int end = 0;
  while (end < 1000 && !watch.noteStep(0.1 * end, rate(end))) ++end;
  ASSERT_LT(end, 1000);
  watch.reset();
  for (int n = 0; n < end; ++n) ASSERT_FALSE(watch.noteStep(0.1 * n, rate(n))) << n;
  watch.reset();
  EXPECT_FALSE(watch.noteStep(0.1 * end, rate(end)));
}

// --- scenes -----------------------------------------------------------------------------------
/// A motor of a commanded torque drives a propeller through a slipping variator, and everything
/// reaches a steady speed. `motor` are more keys of the motor.
std::string steadyScene(const std::string& motor = "hold: zero_order") {
  return R"yaml(
shafts: [drive, load]
drive: {inertia: 0.8}
load: {inertia: 2.0}
torques: [motor, friction, propeller]
motor: {type: variator_sim/CommandedTorque, shaft: drive, topic: torque, )yaml" +
         motor + R"yaml(}
friction: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "-0.5*w1"}
propeller: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.02*w2*abs(w2)"}
constraints: [variator]
variator: {type: variator_sim/ExpressionConstraint, order: 2,
           expression: "tau*(e2-u*e1)+w2-u*w1", parameters: {tau: 0.2, u: 0.6}}
initial: {velocity: [5, 2]}
)yaml";
}

constexpr double kTolerance = 1e-9;

Scene steady(const std::string& motor = "hold: zero_order") {
  return test::withTolerance(test::sceneFromText(steadyScene(motor)), kTolerance);
}
Scene sleepless(Scene scene) {
  scene.solver.sleep = false;
  return scene;
}

bool sameBytes(const Sample& a, const Sample& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// a is b within `factor` tolerances. Angles: relative to themselves, which grow.
void expectNear(const Sample& a, const Sample& b, double factor, double tolerance = kTolerance) {
  const auto near = [&](double x, double y, const char* what) {
    EXPECT_NEAR(x, y, factor * tolerance * (1.0 + std::abs(y))) << what << " at " << b.time;
  };
  ASSERT_EQ(a.time, b.time);
  for (int i = 0; i < 2; ++i) {
    near(a.angle[i], b.angle[i], "angle");
    near(a.velocity[i], b.velocity[i], "velocity");
    near(a.acceleration[i], b.acceleration[i], "acceleration");
    near(a.applied_torque[i], b.applied_torque[i], "torque");
    near(a.reaction_torque[i], b.reaction_torque[i], "reaction");
  }
}

/// Two runs each err by some tolerances; sleeping adds a tenth of one.
constexpr double kFactor = 20.0;

TEST(Sleep, BeginsAtASteadySpeedAndStepsNoMore) {
  Simulation simulation(steady());
  simulation.command(0, 8.0);
  EXPECT_FALSE(simulation.isSleeping());
  simulation.advanceTo(1.0);
  EXPECT_FALSE(simulation.isSleeping());
  EXPECT_EQ(simulation.statistics().sleeps, 0u);
  simulation.advanceTo(1000.0);
  ASSERT_TRUE(simulation.isSleeping());
  EXPECT_EQ(simulation.statistics().sleeps, 1u);
  const Sample before = simulation.sample();
  const Statistics rested = simulation.statistics();
  EXPECT_GT(before.velocity[0], 1.0);

  simulation.advanceTo(1000.0 + 1e6);
  EXPECT_EQ(simulation.time(), 1000.0 + 1e6);
  EXPECT_TRUE(simulation.isSleeping());
  EXPECT_EQ(simulation.statistics().steps, rested.steps);
  EXPECT_EQ(simulation.statistics().sleeps, 1u);
  EXPECT_EQ(simulation.statistics().right_hand_sides, rested.right_hand_sides);
  const Sample after = simulation.sample();
  EXPECT_EQ(after.time, 1000.0 + 1e6);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(after.velocity[i], before.velocity[i]);
    EXPECT_EQ(after.acceleration[i], before.acceleration[i]);
    EXPECT_EQ(after.applied_torque[i], before.applied_torque[i]);
    const double gone = 1e6 * before.velocity[i];
    EXPECT_NEAR(after.angle[i] - before.angle[i], gone, 1e-12 * std::abs(gone));
  }
  EXPECT_NEAR(after.residual[0], 0.0, 1e-12);
}

// Explicit steps at the bound of their stability never come to rest: auto lets radau5 do it, until
// the next command.
TEST(Sleep, BeginsWhereStabilityLimitsExplicitSteps) {
  Scene scene = test::withTolerance(test::sceneFromText(R"yaml(
shafts: [drive]
drive: {inertia: 1}
torques: [motor, drag]
motor: {type: variator_sim/CommandedTorque, shaft: drive, topic: torque}
drag: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "-50*w1"}
)yaml"),
                                    1e-4);
  Simulation simulation(scene);
  simulation.command(0, 8.0);
  simulation.advanceTo(60.0);
  EXPECT_TRUE(simulation.isSleeping());
  EXPECT_GT(simulation.statistics().implicit_steps, 0u);
  EXPECT_NE(simulation.describeStepper().find("near rest"), std::string::npos)
      << simulation.describeStepper();
  EXPECT_NEAR(simulation.sample().velocity[0], 0.16, 1e-4);
  simulation.command(0, 4.0);
  simulation.sample();
  EXPECT_STREQ(simulation.stepperName(), "dopri5");
  simulation.advanceTo(120.0);
  EXPECT_TRUE(simulation.isSleeping());
  EXPECT_NEAR(simulation.sample().velocity[0], 0.08, 1e-4);
}

TEST(Sleep, SamplesAreThoseOfTheMotionThatNeverSleeps) {
  for (StepperKind stepper :
       {StepperKind::kAuto, StepperKind::kDopri5, StepperKind::kDop853, StepperKind::kFehlberg78,
        StepperKind::kRosenbrock4, StepperKind::kRadau5}) {
    const double tolerance = stepper == StepperKind::kRosenbrock4 ? 1e-7 : kTolerance;
    SCOPED_TRACE(toString(stepper));
    const Scene scene = test::withStepper(test::withTolerance(steady(), tolerance), stepper);
    Simulation sleeping(scene);
    Simulation awake(sleepless(scene));
    sleeping.command(0, 8.0);
    awake.command(0, 8.0);
    for (double t : {1.0, 10.0, 30.0, 50.0, 70.0, 90.0, 120.0, 200.0, 500.0, 2000.0}) {
      sleeping.advanceTo(t);
      awake.advanceTo(t);
      expectNear(sleeping.sample(), awake.sample(), kFactor, tolerance);
    }
    // dopri5's steps are as long as its stability allows: its own errors keep it moving
    if (stepper != StepperKind::kDopri5) {
      EXPECT_TRUE(sleeping.isSleeping());
    }
    EXPECT_FALSE(awake.isSleeping());
    EXPECT_EQ(awake.statistics().sleeps, 0u);
  }
}

TEST(Sleep, ACommandWakes) {
  Simulation sleeping(steady());
  Simulation awake(sleepless(steady()));
  for (Simulation* simulation : {&sleeping, &awake}) {
    simulation->command(0, 8.0);
    simulation->advanceTo(400.0);
  }
  ASSERT_TRUE(sleeping.isSleeping());
  const std::uint64_t steps = sleeping.statistics().steps;
  for (Simulation* simulation : {&sleeping, &awake}) simulation->command(0, 3.0);
  // it takes effect at once, by the jump map
  expectNear(sleeping.sample(), awake.sample(), kFactor);
  EXPECT_FALSE(sleeping.isSleeping());
  EXPECT_NEAR(sleeping.sample().applied_torque[0], 3.0 - 0.5 * awake.sample().velocity[0], 1e-7);
  for (double t : {400.01, 400.5, 401.0, 404.0, 420.0, 450.0, 800.0}) {
    sleeping.advanceTo(t);
    awake.advanceTo(t);
    expectNear(sleeping.sample(), awake.sample(), kFactor);
  }
  EXPECT_GT(sleeping.statistics().steps, steps);
  EXPECT_TRUE(sleeping.isSleeping());
  EXPECT_EQ(sleeping.statistics().sleeps, 2u);
}

TEST(Sleep, ACommandOfTheSameValueDoesNotWake) {
  Simulation repeated(steady());
  Simulation plain(steady());
  for (Simulation* simulation : {&repeated, &plain}) {
    simulation->command(0, 8.0);
    simulation->advanceTo(400.0);
    ASSERT_TRUE(simulation->isSleeping());
  }
  const std::uint64_t steps = repeated.statistics().steps;
  for (int n = 1; n <= 10; ++n) {
    repeated.command(0, 8.0);
    repeated.advanceTo(400.0 + n);
    EXPECT_TRUE(repeated.isSleeping());
  }
  EXPECT_EQ(repeated.statistics().steps, steps);
  EXPECT_EQ(repeated.statistics().sleeps, 1u);
  EXPECT_EQ(repeated.statistics().jumps, plain.statistics().jumps);
  plain.advanceTo(410.0);
  EXPECT_TRUE(sameBytes(repeated.sample(), plain.sample()));
}

TEST(Sleep, ARefusedCommandDoesNotWake) {
  Simulation simulation(steady());
  simulation.command(0, 8.0);
  simulation.advanceTo(400.0);
  ASSERT_TRUE(simulation.isSleeping());
  EXPECT_EQ(simulation.command(0, std::nan("")), CommandResult::kRefused);
  simulation.advanceTo(401.0);
  EXPECT_TRUE(simulation.isSleeping());
}

TEST(Sleep, SamplingWhileAsleepDoesNotChangeTheMotion) {
  const auto play = [](int samples) {
    Simulation simulation(steady());
    simulation.command(0, 8.0);
    simulation.advanceTo(400.0);
    EXPECT_TRUE(simulation.isSleeping());
    for (int n = 1; n <= samples; ++n) {
      simulation.advanceTo(400.0 + 100.0 * n / (samples + 1));
      simulation.sample();
    }
    simulation.advanceTo(500.0);
    simulation.command(0, 3.0);
    simulation.advanceTo(503.0);
    return simulation.sample();
  };
  const Sample once = play(0);
  EXPECT_TRUE(sameBytes(once, play(1)));
  EXPECT_TRUE(sameBytes(once, play(1000)));
}

/// Whether it sleeps at some of many moments until `end`.
bool sleepsBefore(Simulation& simulation, double end) {
  const double start = simulation.time();
  for (int n = 1; n <= 100; ++n) {
    simulation.advanceTo(start + (end - start) * n / 100);
    if (simulation.isSleeping()) return true;
  }
  EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  return false;
}

// Steady at first; then the input creeps for many minutes, and the motion with it.
TEST(Sleep, AnInputThatMovesKeepsItAwake) {
  for (const std::string hold :
       {"hold: first_order_lag, time_constant: 60", "hold: second_order_lag, time_constant: 60",
        "hold: rate_limit, rate: 0.01", "hold: first_order_hold, period: 600"}) {
    SCOPED_TRACE(hold);
    const Scene scene = steady(hold + ", initial: 8");
    Simulation sleeping(scene);
    Simulation awake(sleepless(scene));
    sleeping.advanceTo(400.0);
    awake.advanceTo(400.0);
    ASSERT_TRUE(sleeping.isSleeping());
    sleeping.command(0, 2.0);
    awake.command(0, 2.0);
    sleeping.sample();
    EXPECT_FALSE(sleeping.isSleeping());
    EXPECT_FALSE(sleepsBefore(sleeping, 950.0));
    awake.advanceTo(950.0);
    expectNear(sleeping.sample(), awake.sample(), kFactor);
  }
}

// A ramp that arrived is over.
TEST(Sleep, BeginsAfterARampHasArrived) {
  for (const std::string hold :
       {"hold: rate_limit, rate: 0.1", "hold: first_order_hold, period: 60"}) {
    SCOPED_TRACE(hold);
    const Scene scene = steady(hold + ", initial: 8");
    Simulation sleeping(scene);
    Simulation awake(sleepless(scene));
    for (Simulation* simulation : {&sleeping, &awake}) {
      simulation->advanceTo(400.0);
      simulation->command(0, 2.0);
      simulation->advanceTo(1000.0);
    }
    EXPECT_TRUE(sleeping.isSleeping());
    EXPECT_EQ(sleeping.statistics().sleeps, 2u);
    expectNear(sleeping.sample(), awake.sample(), kFactor);
  }
}

TEST(Sleep, NeverWhereSomethingReadsTheTime) {
  // at a standstill for the first hour, but for one who knows the formula
  const std::string parts[2] = {
      "torque: \"1e-3*max(0,t-3600)-w1\"}\n",
      "torque: \"-w1\"}\nconstraints: [belt]\nbelt: {type: variator_sim/ExpressionConstraint, "
      "order: 2, expression: \"e2-e1+(w2-w1)-1e-3*max(0,t-3600)\"}\n"};
  for (const std::string& part : parts) {
    Simulation simulation(test::sceneFromText(
        "shafts: [drive, load]\ndrive: {inertia: 1}\nload: {inertia: 1}\n"
        "torques: [motor]\nmotor: {type: variator_sim/ExpressionTorque, shaft: drive, " +
        part));
    EXPECT_FALSE(sleepsBefore(simulation, 3600.0));
    simulation.advanceTo(3700.0);
    EXPECT_GT(std::abs(simulation.sample().velocity[0]) + std::abs(simulation.sample().velocity[1]),
              1e-3);
    EXPECT_EQ(simulation.statistics().sleeps, 0u);
  }
}

TEST(Sleep, NeverWhereTheSceneForbidsIt) {
  Simulation simulation(test::sceneFromText(steadyScene() + "solver: {sleep: false}\n"));
  simulation.command(0, 8.0);
  EXPECT_FALSE(sleepsBefore(simulation, 1000.0));
  EXPECT_EQ(simulation.statistics().sleeps, 0u);
}

TEST(Sleep, NeverInFixedSteps) {
  for (StepperKind stepper : {StepperKind::kRk4, StepperKind::kDopri5Fixed,
                              StepperKind::kRosenbrock4Fixed, StepperKind::kRadau5Fixed}) {
    Scene scene = test::withStepper(steady(), stepper);
    scene.solver.step = 0.05;
    Simulation simulation(std::move(scene));
    simulation.command(0, 8.0);
    EXPECT_FALSE(sleepsBefore(simulation, 400.0)) << toString(stepper);
    EXPECT_EQ(simulation.statistics().steps, 8000u) << toString(stepper);
  }
}

// Under `gauss` the accelerations come from the coupling's angles, which turn: they are part of the
// motion and are not at rest. Standing still they are.
TEST(Sleep, NotWhereAnglesThatAreReadTurn) {
  const auto scene = [](const std::string& principle, double drag, double speed) {
    const std::string w = std::to_string(speed);
    return test::sceneFromText(R"yaml(
shafts: [drive, load]
drive: {inertia: 0.8}
load: {inertia: 2.0}
torques: [coupling, drag]
coupling: {type: variator_sim/ElasticCoupling, shafts: [drive, load], stiffness: 50, damping: 5}
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-d*w2", parameters: {d: )yaml" +
                               std::to_string(drag) + "}}\nprinciple: " + principle +
                               "\ninitial: {velocity: [" + w + ", " + w + "]}\n");
  };
  Simulation turning(scene("gauss", 0.0, 10.0));
  EXPECT_FALSE(sleepsBefore(turning, 300.0));
  EXPECT_NEAR(turning.sample().angle[0], 3000.0, 1e-5);
  EXPECT_NEAR(turning.sample().angle[1], 3000.0, 1e-5);
  // The coupling's fast mode limits explicit steps, whose error keeps the rates up: radau5 has to
  // take over.
  Simulation stopping(scene("gauss", 5.0, 10.0));
  EXPECT_TRUE(sleepsBefore(stopping, 300.0));
  EXPECT_NEAR(stopping.sample().velocity[0], 0.0, 1e-8);
  // by torque rates the angles are a quadrature, which may turn
  Simulation rates(scene("generalized_gauss", 0.0, 10.0));
  EXPECT_TRUE(sleepsBefore(rates, 300.0));
  rates.advanceTo(300.0);
  EXPECT_NEAR(rates.sample().angle[0], 3000.0, 1e-5);
}

TEST(Sleep, BeginsAtOnceAtAnEquilibrium) {
  std::string still = steadyScene();
  still.replace(still.find("[5, 2]"), 6, "[0, 0]");
  Simulation standing(test::withTolerance(test::sceneFromText(still), kTolerance));
  EXPECT_FALSE(standing.isSleeping());  // nothing has been stepped
  standing.advanceTo(1e-6);
  EXPECT_TRUE(standing.isSleeping());
  EXPECT_EQ(standing.statistics().steps, 1u);
  standing.advanceTo(1e6);
  EXPECT_EQ(standing.statistics().steps, 1u);
  EXPECT_EQ(standing.sample().angle[0], 0.0);
  standing.command(0, 8.0);
  standing.advanceTo(1e6 + 1.0);
  EXPECT_FALSE(standing.isSleeping());
  EXPECT_GT(standing.sample().velocity[0], 0.1);

  // and turning freely
  Simulation free(test::sceneFromText("shafts: [a]\na: {inertia: 1}\ninitial: {velocity: [3]}\n"));
  free.advanceTo(10.0);
  EXPECT_TRUE(free.isSleeping());
  EXPECT_EQ(free.statistics().steps, 1u);
  EXPECT_NEAR(free.sample().angle[0], 30.0, 1e-13);
}

TEST(Sleep, AnOverdueCommandWakesAtItsInstant) {
  const Scene scene = steady("hold: zero_order, timeout: 500, on_timeout: zero");
  Simulation sleeping(scene);
  Simulation awake(sleepless(scene));
  for (Simulation* simulation : {&sleeping, &awake}) {
    simulation->command(0, 8.0);
    simulation->advanceTo(499.0);
  }
  ASSERT_TRUE(sleeping.isSleeping());
  EXPECT_EQ(sleeping.statistics().command_timeouts, 0u);
  for (double t : {500.5, 503.0, 520.0}) {
    sleeping.advanceTo(t);
    awake.advanceTo(t);
    expectNear(sleeping.sample(), awake.sample(), kFactor);
    EXPECT_FALSE(sleeping.isSleeping());
  }
  EXPECT_EQ(sleeping.statistics().command_timeouts, 1u);
  // and in one advance over the instant
  Simulation once(scene);
  once.command(0, 8.0);
  once.advanceTo(503.0);
  awake.reset();
  awake.command(0, 8.0);
  awake.advanceTo(503.0);
  expectNear(once.sample(), awake.sample(), kFactor);
}

TEST(Sleep, ResetWakes) {
  Simulation simulation(steady());
  const auto play = [&] {
    simulation.command(0, 8.0);
    simulation.advanceTo(3.0);
    EXPECT_FALSE(simulation.isSleeping());
    return simulation.sample();
  };
  const Sample first = play();
  simulation.advanceTo(400.0);
  ASSERT_TRUE(simulation.isSleeping());
  simulation.reset();
  EXPECT_FALSE(simulation.isSleeping());
  EXPECT_EQ(simulation.statistics().sleeps, 0u);
  EXPECT_EQ(simulation.time(), 0.0);
  EXPECT_TRUE(sameBytes(first, play()));
}

TEST(Sleep, CostsHardlyAnything) {
  Simulation sleeping(steady());
  Simulation awake(sleepless(steady()));
  for (Simulation* simulation : {&sleeping, &awake}) {
    simulation->command(0, 8.0);
    simulation->advanceTo(400.0);
  }
  ASSERT_TRUE(sleeping.isSleeping());
  const std::uint64_t asleep = sleeping.statistics().right_hand_sides;
  const std::uint64_t stepped = awake.statistics().right_hand_sides;
  for (int n = 1; n <= 20; ++n) {
    sleeping.advanceTo(400.0 + 500.0 * n);
    awake.advanceTo(400.0 + 500.0 * n);
    sleeping.sample();
    awake.sample();
  }
  // a sample takes one evaluation for its jerk
  const std::uint64_t cost = sleeping.statistics().right_hand_sides - asleep;
  EXPECT_LE(cost, 20u);
  EXPECT_LE(100u * cost, awake.statistics().right_hand_sides - stepped);
}

// A moment without acceleration at the top speed of a slow swing (20 and 200 minutes) is no rest.
TEST(Sleep, NotInASlowOscillation) {
  for (double frequency : {5e-3, 5e-4}) {
    for (const char* principle : {"generalized_gauss", "gauss"}) {
      char yaml[400];
      std::snprintf(yaml, sizeof yaml,
                    "shafts: [wheel]\nwheel: {inertia: 1}\ntorques: [spring]\nspring: {type: "
                    "variator_sim/ExpressionTorque, shaft: wheel, torque: \"-k*phi1\", parameters: "
                    "{k: %.17g}}\nprinciple: %s\ninitial: {angle: [0.1]}\n",
                    frequency * frequency, principle);
      Simulation simulation(test::withTolerance(test::sceneFromText(yaml), 1e-6));
      const double period = 2.0 * std::acos(-1.0) / frequency;
      EXPECT_FALSE(sleepsBefore(simulation, 1.5 * period)) << principle << ", " << frequency;
      simulation.advanceTo(1.5 * period);
      EXPECT_NEAR(simulation.sample().angle[0], -0.1, 1e-3) << principle << ", " << frequency;
    }
  }
}

// A slow mode beside a fast one: the fast one's fall is no rest for the slow one.
TEST(Sleep, WaitsForTheSlowestPartOfTheMotion) {
  Scene scene = test::withTolerance(test::sceneFromText(R"yaml(
shafts: [fast, slow]
fast: {inertia: 1}
slow: {inertia: 1000}
torques: [one, other]
one: {type: variator_sim/ExpressionTorque, shaft: fast, torque: "-10*w1"}
other: {type: variator_sim/ExpressionTorque, shaft: slow, torque: "-w2"}
initial: {velocity: [10, 1e-3]}
)yaml"),
                                    1e-6);
  Simulation simulation(test::withStepper(std::move(scene), StepperKind::kRadau5));
  for (double t : {1.0, 10.0, 100.0, 1000.0, 5000.0, 20000.0, 100000.0}) {
    simulation.advanceTo(t);
    EXPECT_NEAR(simulation.sample().velocity[1], 1e-3 * std::exp(-t / 1000.0), 2e-6) << t;
  }
  EXPECT_TRUE(simulation.isSleeping());
}

}  // namespace
}  // namespace variator_sim
