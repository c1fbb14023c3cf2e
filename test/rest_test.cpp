// Motions at rest: steps become few and long, samples stay right, and everything that moves makes
// them short again.
#include <random>

#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::plainly;

// --- scenes -----------------------------------------------------------------------------------
/// A motor of a commanded torque drives a propeller through a slipping variator, and everything
/// reaches a steady speed. `motor` are more keys of the motor.
std::string steadyScene(const std::string& motor = "hold: zero_order") {
  return test::sceneText("drive 0.8, load 2",
                         {std::string("motor on drive from torque, ") + motor,
                          "friction on drive: -0.5*w1", "propeller on load: -0.02*w2*abs(w2)",
                          "variator = ExpressionConstraint, order: 2, expression: "
                          "'tau*(e2-u*e1)+w2-u*w1', parameters: {tau: 0.2, u: 0.6}"},
                         "initial: {velocity: [5, 2]}");
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

TEST(Sleep, BeginsAtASteadySpeedAndHardlyStepsAnyMore) {
  Simulation simulation(steady());
  simulation.command(0, 8.0);
  EXPECT_FALSE(simulation.isSleeping());
  simulation.advanceTo(1.0);
  EXPECT_FALSE(simulation.isSleeping());
  EXPECT_EQ(simulation.statistics().sleeps, 0u);
  simulation.advanceTo(1000.0);
  ASSERT_TRUE(simulation.isSleeping());
  EXPECT_GE(simulation.statistics().sleeps, 1u);
  const Sample before = simulation.sample();
  const Statistics rested = simulation.statistics();
  EXPECT_GT(before.velocity[0], 1.0);

  simulation.advanceTo(1000.0 + 1e5);
  EXPECT_EQ(simulation.time(), 1000.0 + 1e5);
  EXPECT_TRUE(simulation.isSleeping());
  EXPECT_LE(simulation.statistics().steps, rested.steps + 1200);
  EXPECT_LE(simulation.statistics().right_hand_sides, rested.right_hand_sides + 1200);
  const Sample after = simulation.sample();
  EXPECT_EQ(after.time, 1000.0 + 1e5);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(after.velocity[i], before.velocity[i], 1e-13 * before.velocity[i]);
    EXPECT_NEAR(after.acceleration[i], 0.0, 1e-13);
    EXPECT_NEAR(after.applied_torque[i], before.applied_torque[i], 1e-13);
    const double gone = 1e5 * before.velocity[i];
    EXPECT_NEAR(after.angle[i] - before.angle[i], gone, 1e-12 * std::abs(gone));
  }
  EXPECT_NEAR(after.residual[0], 0.0, 1e-12);
}

const std::string kFastDrag =
    test::sceneText("drive 1", {"motor on drive from torque", "drag on drive: -50*w1"});

// Steps by series at the bound of their stability never come to rest: auto lets radau do it.
TEST(Sleep, BeginsWhereStabilityLimitsExplicitSteps) {
  constexpr double kCoarse = 1e-2;
  Simulation simulation(test::withTolerance(test::sceneFromText(kFastDrag), kCoarse));
  simulation.command(0, 8.0);
  simulation.advanceTo(60.0);
  EXPECT_TRUE(simulation.isSleeping());
  EXPECT_GT(simulation.statistics().implicit_steps, 0u);
  EXPECT_NEAR(simulation.sample().velocity[0], 0.16, kCoarse);
  simulation.command(0, 4.0);
  simulation.advanceTo(120.0);
  EXPECT_TRUE(simulation.isSleeping());
  EXPECT_NEAR(simulation.sample().velocity[0], 0.08, kCoarse);
}

// The length of a step leaves less of what has died away than the tolerance that it is asked for.
TEST(Sleep, BeginsAfterFewStepsAtEveryTolerance) {
  for (const double tolerance : {1e-2, 1e-4, 1e-6, 1e-9}) {
    Simulation simulation(test::withTolerance(test::sceneFromText(kFastDrag), tolerance));
    simulation.command(0, 8.0);
    simulation.advanceTo(60.0);
    EXPECT_TRUE(simulation.isSleeping());
    EXPECT_LE(simulation.statistics().steps, 50u);
    EXPECT_NEAR(simulation.sample().velocity[0], 0.16, tolerance);
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
  EXPECT_LE(repeated.statistics().steps, steps + 1);
  EXPECT_EQ(repeated.statistics().jumps, plain.statistics().jumps);
  EXPECT_EQ(repeated.command(0, std::nan("")), CommandResult::kRefused);
  plain.advanceTo(410.0);
  EXPECT_TRUE(sameBytes(repeated.sample(), plain.sample()));
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
  for (StepperKind stepper : {StepperKind::kRk4, StepperKind::kTaylorFixed}) {
    Scene scene = test::withStepper(steady(), stepper);
    scene.solver.step = 0.05;
    Simulation simulation(std::move(scene));
    simulation.command(0, 8.0);
    EXPECT_FALSE(sleepsBefore(simulation, 400.0)) << toString(stepper);
    EXPECT_EQ(simulation.statistics().steps, 8000u) << toString(stepper);
  }
}

// The coupling's torque comes from angles, which turn: they are part of the motion and are not at
// rest. Standing still they are.
TEST(Sleep, NotWhereAnglesThatAreReadTurn) {
  const auto scene = [](const std::string& principle, double drag, double speed) {
    const std::string w = std::to_string(speed);
    return test::sceneFromText(
        "drive 0.8, load 2",
        {"coupling = ElasticCoupling, shafts: [drive, load], stiffness: 50, damping: 5",
         "drag = ExpressionTorque, shaft: load, torque: '-d*w2', parameters: {d: " +
             std::to_string(drag) + "}"},
        std::string("principle: ") + principle + "\ninitial: {velocity: [" + w + ", " + w + "]}");
  };
  Simulation turning(scene("gauss", 0.0, 10.0));
  EXPECT_FALSE(sleepsBefore(turning, 300.0));
  EXPECT_NEAR(turning.sample().angle[0], 3000.0, 1e-5);
  EXPECT_NEAR(turning.sample().angle[1], 3000.0, 1e-5);
  // The coupling's fast mode limits explicit steps, whose error keeps the rates up: radau has to
  // take over.
  Simulation stopping(scene("gauss", 5.0, 10.0));
  EXPECT_TRUE(sleepsBefore(stopping, 300.0));
  EXPECT_NEAR(stopping.sample().velocity[0], 0.0, 1e-8);
}

TEST(Sleep, BeginsAtOnceAtAnEquilibrium) {
  std::string still = steadyScene();
  still.replace(still.find("[5, 2]"), 6, "[0, 0]");
  Simulation standing(test::withTolerance(test::sceneFromText(still), kTolerance));
  EXPECT_FALSE(standing.isSleeping());  // nothing has been stepped
  standing.advanceTo(1e-6);
  EXPECT_TRUE(standing.isSleeping());
  EXPECT_EQ(standing.statistics().steps, 1u);
  standing.advanceTo(1e4);
  EXPECT_LT(standing.statistics().steps, 120u);
  EXPECT_EQ(standing.sample().angle[0], 0.0);
  standing.command(0, 8.0);
  standing.advanceTo(1e4 + 1.0);
  EXPECT_FALSE(standing.isSleeping());
  EXPECT_GT(standing.sample().velocity[0], 0.1);

  // and turning freely
  Simulation free(test::sceneFromText("a 1", {}, "initial: {velocity: [3]}"));
  free.advanceTo(10.0);
  EXPECT_TRUE(free.isSleeping());
  EXPECT_LE(free.statistics().steps, 4u);
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

// --- against closed forms ------------------------------------------------------------------------
/// One shaft of inertia 1 (or two equal ones): omega' = q - omega/T - k phi.
struct Mode {
  double decay;      // 1/T, 1/s
  double stiffness;  // k, 1/s^2
  double drive;      // q
  double angle;
  double velocity;

  /// (phi, omega) at t
  std::pair<double, double> at(double t) const {
    if (stiffness == 0.0) {
      if (decay == 0.0) return {angle + t * (velocity + 0.5 * t * drive), velocity + drive * t};
      const double end = drive / decay;
      const double gone = -std::expm1(-decay * t);
      return {angle + end * t + (velocity - end) / decay * gone,
              end + (velocity - end) * (1 - gone)};
    }
    // y'' + decay y' + stiffness y = 0
    const double y = angle - drive / stiffness;
    const double half = 0.5 * decay;
    const double square = half * half - stiffness;
    const double root = std::sqrt(std::abs(square));
    if (square < 0.0) {
      const double e = std::exp(-half * t);
      const double c = std::cos(root * t);
      const double s = std::sin(root * t) / root;
      return {drive / stiffness + e * (y * c + (velocity + half * y) * s),
              e * (velocity * c - (half * velocity + stiffness * y) * s)};
    }
    // slow and fast one: p1 p2 = stiffness
    const double p2 = -half - root;
    const double p1 = stiffness / p2;
    const double a = (velocity - p2 * y) / (p1 - p2);
    const double b = (p1 * y - velocity) / (p1 - p2);
    return {drive / stiffness + a * std::exp(p1 * t) + b * std::exp(p2 * t),
            p1 * a * std::exp(p1 * t) + p2 * b * std::exp(p2 * t)};
  }
};

/// A scene of shafts that have one mode each.
std::string modesText(const std::vector<Mode>& modes) {
  std::string shafts;
  std::vector<std::string> torques;
  std::string angles;
  std::string velocities;
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const std::string name(1, "abc"[i]);
    const std::string comma = i > 0 ? ", " : "";
    const Mode& m = modes[i];
    shafts += comma + name + " 1";
    angles += comma + plainly(m.angle);
    velocities += comma + plainly(m.velocity);
    torques.push_back("q" + name + " on " + name + ": " + plainly(m.drive) + "-(" +
                      plainly(m.decay) + ")*w_" + name);
    if (m.stiffness != 0.0) torques.back() += "-(" + plainly(m.stiffness) + ")*phi_" + name;
  }
  return test::sceneText(shafts, torques,
                         "initial: {angle: [" + angles + "], velocity: [" + velocities + "]}");
}

/// The largest error at the time of the sample, in tolerances.
double errorInTolerances(const Sample& sample, const std::vector<Mode>& modes, double tolerance) {
  double largest = 0.0;
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const auto [angle, velocity] = modes[i].at(sample.time);
    largest = std::max(
        {largest, std::abs(sample.angle[i] - angle) / (tolerance * (1.0 + std::abs(angle))),
         std::abs(sample.velocity[i] - velocity) / (tolerance * (1.0 + std::abs(velocity)))});
  }
  return largest;
}

constexpr const char* kPrinciples[] = {"generalized_gauss", "gauss"};
/// Until then velocities are compared by the angles that they lead to, s. Under generalized_gauss
/// the steps to there leave their error in a reaction that nothing pulls back.
double endOf(const std::string& principle) {
  return principle == "gauss" ? 1e7 : 1e5;
}

// Time constants of a millisecond to hours beside each other; driven, spinning, sprung, standing.
TEST(Sleep, KeepsTheToleranceOfSlowModesBesideFastOnes) {
  std::mt19937 random(5);
  const auto uniform = [&random](double from, double to) {
    return from + (to - from) * static_cast<double>(random()) / 4294967296.0;
  };
  int sleeps = 0;
  constexpr int kScenes = 60;
  for (int n = 0; n < kScenes; ++n) {
    std::vector<Mode> modes;
    const int count = 1 + n % 3;
    const bool sprung = n % 4 == 3;
    for (int i = 0; i < count; ++i) {
      Mode mode{};
      mode.decay = std::pow(10.0, -uniform(-3.0, 3.5));
      mode.angle = uniform(-1.0, 1.0);
      mode.velocity = std::pow(10.0, uniform(-6.0, 1.0));
      if (sprung) {
        mode.stiffness = mode.decay * mode.decay * std::pow(10.0, uniform(-1.0, 1.0));
      } else if (uniform(0.0, 1.0) < 0.4) {
        mode.drive = uniform(-2.0, 2.0) * mode.decay;
      }
      modes.push_back(mode);
    }
    const double tolerance = std::pow(10.0, uniform(-10.0, -6.0));
    Scene scene = test::sceneFromText(modesText(modes) + "principle: " + kPrinciples[n / 3 % 2] +
                                      "\nsolver: {maximum_step: 10}\n");
    Simulation simulation(test::withTolerance(std::move(scene), tolerance));
    for (double t : {1.0, 10.0, 100.0, 1e3, 3e3, 1e4, 3e4, 1e5, 1e6, 1e7}) {
      if (t > endOf(kPrinciples[n / 3 % 2])) break;
      simulation.advanceTo(t);
      ASSERT_TRUE(simulation.status().ok()) << n << ": " << simulation.describeStatus();
      const double error = errorInTolerances(simulation.sample(), modes, tolerance);
      EXPECT_LE(error, 3.0) << "scene " << n << " at " << t << ", sleeping "
                            << simulation.isSleeping() << "\n"
                            << modesText(modes);
    }
    sleeps += simulation.isSleeping() ? 1 : 0;
  }
  EXPECT_GE(sleeps, kScenes * 9 / 10);  // the others step on
}

// A residual velocity of 1e-12 rad/s would turn the shaft by 1e-5 rad.
TEST(Sleep, AnglesDoNotCreep) {
  for (const char* principle : kPrinciples) {
    for (double decay : {0.02, 1.0, 50.0}) {
      const std::vector<Mode> modes = {{decay, 0.0, 0.0, 0.0, 1.0}};
      Simulation simulation(
          test::sceneFromText(modesText(modes) + "principle: " + principle + "\n"));
      for (double t : {50.0, 100.0, 2000.0, 1e5, 1e7, 1e9}) {
        if (t > endOf(principle)) break;
        simulation.advanceTo(t);
        EXPECT_LE(errorInTolerances(simulation.sample(), modes, kTolerance), 0.3)
            << principle << ", " << decay << " at " << t;
      }
      EXPECT_TRUE(simulation.isSleeping());
    }
  }
}

// A torque of 1e-14 N m alone changes the speed within months; a term of rest takes it for nothing,
// but its end does not.
TEST(Sleep, ItsTermEndsAndIsRenewed) {
  for (const char* principle : kPrinciples) {
    const std::vector<Mode> modes = {{1e-9, 0.0, 1e-14, 0.0, 0.0}};
    Simulation simulation(test::sceneFromText(modesText(modes) + "principle: " + principle + "\n"));
    for (int n = 1; n <= 100; ++n) {
      simulation.advanceTo(1e5 * n);
      EXPECT_LE(errorInTolerances(simulation.sample(), modes, kTolerance), 0.5)
          << principle << " at " << n << "e5 s";
    }
    EXPECT_GT(simulation.sample().velocity[0], 9e-8);
    EXPECT_LT(simulation.statistics().steps, 1000000u) << "it did not sleep";
    EXPECT_GE(simulation.statistics().sleeps, 1u);
  }
}

TEST(Sleep, DoesNotDependOnHowATermIsCut) {
  const std::vector<Mode> modes = {{1e-9, 0.0, 1e-14, 0.0, 0.0}, {1.0, 0.0, 2.0, 0.0, 0.0}};
  const auto play = [&](int cuts) {
    Simulation simulation(test::sceneFromText(modesText(modes)));
    for (int n = 1; n <= cuts; ++n) {
      simulation.advanceTo(3e5 * n / cuts);
      simulation.sample();
    }
    return simulation.sample();
  };
  const Sample once = play(1);
  EXPECT_TRUE(sameBytes(once, play(2)));
  EXPECT_TRUE(sameBytes(once, play(12345)));
}

// A pendulum that stands on its head for a while, and a shaft whose friction drives.
TEST(Sleep, NotAtASaddle) {
  for (const char* principle : kPrinciples) {
    for (double growth : {0.05, 1.0}) {
      const std::string k = plainly(growth * growth);
      Simulation simulation(test::sceneFromText("a 1", {std::string("q on a: ") + k + "*phi1"},
                                                "initial: {angle: [1e-12], velocity: [-" +
                                                    plainly(growth * (1e-12 - 1e-16)) +
                                                    "]}\nprinciple: " + principle));
      // phi = (1e-12 - 5e-17) e^(-g t) + 5e-17 e^(g t)
      for (double gt : {5.0, 10.0, 20.0, 30.0, 35.0}) {
        simulation.advanceTo(gt / growth);
        EXPECT_NEAR(simulation.sample().angle[0], 5e-17 * std::exp(gt) + 1e-12 * std::exp(-gt),
                    0.02 * 5e-17 * std::exp(gt) + 1e-9)
            << principle << ", " << growth << " at " << gt;
      }
      EXPECT_FALSE(simulation.isSleeping());
    }
    // exactly there it stays
    Simulation exact(
        test::sceneFromText("a 1", {"q on a: phi1"}, "principle: " + std::string(principle)));
    exact.advanceTo(1e6);
    EXPECT_TRUE(exact.isSleeping());
    EXPECT_EQ(exact.sample().angle[0], 0.0);
  }
}

}  // namespace
}  // namespace variator_sim
