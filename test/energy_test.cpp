// The energy account: against closed forms and a quadrature of the samples' own columns.
// (test/stress/repeatability_test.cpp has that samples change neither the motion nor the account.)
#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr StepperKind kSteppers[] = {StepperKind::kAuto,       StepperKind::kDopri5,
                                     StepperKind::kFehlberg78, StepperKind::kRadau,
                                     StepperKind::kTaylor,     StepperKind::kRk4};

const std::string kFreeShaft =
    test::sceneText("wheel 0.8", {"bearing on wheel: -0.3*w1"}, "initial: {velocity: [7]}");

// C turns with time, by one radian and more.
const std::string kVaryingRatio = test::sceneText(
    "drive 0.8, load 2",
    {"motor on drive: 40 - 0.5*w1 + 3*sin(2*t)", "propeller on load: -0.05*w2*sqrt(w2^2 + 1)",
     "variator: 0.2*(e2 - (1 + 0.6*sin(0.7*t))*e1) + w2 - (1 + 0.6*sin(0.7*t))*w1"},
    "initial: {velocity: [5, 5]}");

const std::string kCrank =
    test::sceneText("drive 0.8, crank",
                    {"motor on drive: 40 - 2*w1", "load on crank: -0.7*w2*(1 + 0.3*sin(phi2))",
                     "gear: 0.2*(e2 - 0.6*e1) + w2 - 0.6*w1"},
                    "crank: {inertia: {mean: 2, harmonics: [{order: 2, cos: 0.04, sin: 0.02}]}}\n"
                    "initial: {velocity: [5, 2]}");

// Comes to a rest in which the slip goes on: the reactions take what the motor brings.
const std::string kSlippingRest =
    test::sceneText("drive 0.8, load 2",
                    {"motor on drive from torque, hold: zero_order, initial: 10",
                     "brake on load: -0.9*w2", "variator: 0.2*(e2 - 0.6*e1) + w2 - 0.6*w1 + 1"},
                    "initial: {velocity: [5, 2]}");

Scene withPrinciple(Scene scene, Principle principle) {
  scene.principle = principle;
  return scene;
}

Simulation tracked(Scene scene) {
  Simulation simulation(std::move(scene));
  simulation.trackEnergy(true);
  return simulation;
}

Energy energyAt(Simulation& simulation, double time) {
  EXPECT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
  return simulation.sample().energy;
}

// --- closed forms -----------------------------------------------------------------------------
TEST(Energy, OfAFreeShaftIsWhatTheBearingTakes) {
  for (StepperKind stepper : kSteppers) {
    for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
      Scene scene = test::withStepper(test::sceneFromText(kFreeShaft), stepper);
      Simulation simulation = tracked(withPrinciple(std::move(scene), principle));
      const double start = 0.5 * 0.8 * 49.0;
      for (double t : {0.0, 0.013, 1.0, 3.3, 8.0}) {
        const Energy energy = energyAt(simulation, t);
        const double omega = 7.0 * std::exp(-0.3 / 0.8 * t);
        const double kinetic = 0.5 * 0.8 * omega * omega;
        EXPECT_NEAR(energy.kinetic, kinetic, 1e-7) << simulation.stepperName() << ", " << t;
        EXPECT_NEAR(energy.applied, kinetic - start, 1e-7) << simulation.stepperName() << ", " << t;
        EXPECT_NEAR(energy.reactions, 0.0, 1e-7) << simulation.stepperName() << ", " << t;
        EXPECT_NEAR(energy.applied_power, -0.3 * omega * omega, 1e-7);
        EXPECT_NEAR(energy.reaction_power, 0.0, 1e-12);
      }
    }
  }
}

// psi = J1 omega1 eps1 + J2 omega2 eps2 - P(t): T = T(0) + integral of P, whatever the torques.
TEST(Energy, FollowsAnImposedPower) {
  Simulation simulation = tracked(test::sceneFromText(
      "drive 0.8, load 2",
      {"motor on drive: 4 + 3*cos(2*t)", "power: 0.8*w1*e1 + 2*w2*e2 - (5 + 4*cos(t))"},
      "initial: {velocity: [5, 2]}"));
  const double start = 0.5 * (0.8 * 25.0 + 2.0 * 4.0);
  for (double t : {0.5, 2.0, 5.0, 10.0}) {
    const Energy energy = energyAt(simulation, t);
    const double brought = 5.0 * t + 4.0 * std::sin(t);
    EXPECT_NEAR(energy.kinetic, start + brought, 1e-6);
    EXPECT_NEAR(energy.applied + energy.reactions, brought, 1e-6);
    EXPECT_NEAR(energy.applied_power + energy.reaction_power, 5.0 + 4.0 * std::cos(t), 1e-8);
  }
}

TEST(Energy, AConstantGearBringsNone) {
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    Simulation simulation = tracked(withPrinciple(
        test::sceneFromText(
            "drive 10, load 100",
            {"motor on drive: 6", "gear = KinematicRatio, shafts: [drive, load], ratio: -0.1"}),
        principle));
    for (double t : {1.0, 10.0, 100.0}) {
      const Energy energy = energyAt(simulation, t);
      const double velocity = 6.0 / 11.0 * t;
      EXPECT_NEAR(energy.applied, 3.0 * velocity * t, 1e-11 * energy.applied);
      EXPECT_NEAR(energy.reactions, 0.0, 1e-11 * energy.applied);
      EXPECT_NEAR(energy.reaction_power, 0.0, 1e-12 * energy.applied_power);
    }
    EXPECT_FALSE(simulation.energyDoubt().exists());
  }
}

// --- an independent quadrature ----------------------------------------------------------------
/// Simpson's rule on the samples' own powers.
void expectEnergiesAreIntegralsOfPowers(const Scene& scene, double tolerance) {
  Simulation simulation = tracked(scene);
  constexpr int kIntervals = 6000;
  constexpr double kEnd = 6.0;
  double applied = 0.0;
  double reactions = 0.0;
  double size = 0.0;
  for (int n = 0; n <= kIntervals; ++n) {
    const Energy energy = energyAt(simulation, kEnd * n / kIntervals);
    const double weight =
        kEnd / kIntervals / 3.0 * (n == 0 || n == kIntervals ? 1 : 2 + 2 * (n % 2));
    applied += weight * energy.applied_power;
    reactions += weight * energy.reaction_power;
    size += weight * std::abs(energy.applied_power);
    if (n % 2 == 1 || n == 0) continue;
    // Up to here, the end counts once.
    const double end = n == kIntervals ? 0.0 : kEnd / kIntervals / 3.0;
    ASSERT_NEAR(energy.applied, applied - end * energy.applied_power, tolerance * (1.0 + size));
    ASSERT_NEAR(energy.reactions, reactions - end * energy.reaction_power,
                tolerance * (1.0 + size));
  }
  EXPECT_GT(size, 10.0);
}

TEST(Energy, IsTheIntegralOfThePowers) {
  for (StepperKind stepper : kSteppers) {
    for (const std::string& scene : {kVaryingRatio, kCrank}) {
      for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
        expectEnergiesAreIntegralsOfPowers(
            withPrinciple(test::withStepper(test::sceneFromText(scene), stepper), principle), 3e-8);
      }
    }
  }
}

// At a coarse tolerance steps are long, and many samples lie in one of them.
TEST(Energy, KeepsToTheToleranceOfTheMotion) {
  for (double tolerance : {1e-4, 1e-6, 1e-11}) {
    Scene scene = test::withTolerance(test::sceneFromText(kVaryingRatio), tolerance);
    expectEnergiesAreIntegralsOfPowers(scene, std::max(3.0 * tolerance, 1e-10));
  }
}

TEST(Energy, IsEstimatedWellWhereItIsNotTracked) {
  for (StepperKind stepper : kSteppers) {
    for (const std::string& text : {kVaryingRatio, kCrank}) {
      for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
        const Scene scene =
            withPrinciple(test::withStepper(test::sceneFromText(text), stepper), principle);
        Simulation exact = tracked(scene);
        Simulation estimated{Scene(scene)};
        for (double t : {0.7, 3.0, 12.0}) {
          const Energy energy = energyAt(exact, t);
          ASSERT_TRUE(estimated.advanceTo(t).ok());
          const Energy estimate = estimated.energy();
          // The longer the steps the less their ends know.
          const bool is_long = stepper == StepperKind::kRadau || stepper == StepperKind::kAuto ||
                               stepper == StepperKind::kTaylor;
          const double part = is_long ? 5e-3 : 1e-4;
          EXPECT_NEAR(estimate.applied, energy.applied, part * std::abs(energy.applied));
          EXPECT_NEAR(estimate.applied + estimate.reactions, energy.applied + energy.reactions,
                      1e-9 * energy.kinetic);
          EXPECT_EQ(estimate.kinetic, energy.kinetic);
          EXPECT_EQ(estimate.applied_power, energy.applied_power);
          EXPECT_EQ(estimated.sample().energy.kinetic, 0.0);
        }
      }
    }
  }
}

// --- commands, rest, reset --------------------------------------------------------------------
// J omega' = u by steps: omega and its energy are sums, and nothing but u brings any.
TEST(Energy, CountsOnAcrossJumpsOfCommands) {
  for (StepperKind stepper : kSteppers) {
    for (bool tracks : {true, false}) {
      Simulation simulation(test::withStepper(
          test::sceneFromText("wheel 2",
                              {"motor on wheel from torque, hold: zero_order, initial: 3"}),
          stepper));
      simulation.trackEnergy(tracks);
      double u = 3.0;
      double velocity = 0.0;
      double time = 0.0;
      for (double t : {0.3, 0.30001, 1.0, 2.5, 2.75, 9.0}) {
        velocity += u / 2.0 * (t - time);
        time = t;
        ASSERT_TRUE(simulation.advanceTo(t).ok());
        u = -1.3 * u;
        simulation.command(0, u);
        const Energy energy = simulation.energy();
        EXPECT_NEAR(energy.applied, velocity * velocity, 1e-9 * (1.0 + velocity * velocity));
        EXPECT_NEAR(energy.reactions, 0.0, 1e-9 * (1.0 + velocity * velocity));
        EXPECT_NEAR(energy.applied_power, u * velocity, 1e-9 * std::abs(u * velocity));
      }
    }
  }
}

TEST(Energy, GoesOnAtRest) {
  Scene scene = test::sceneFromText(kSlippingRest);
  Simulation sleeping = tracked(scene);
  scene.solver.sleep = false;
  Simulation waking = tracked(scene);
  ASSERT_TRUE(sleeping.advanceTo(200.0).ok());
  ASSERT_TRUE(sleeping.isSleeping());
  const auto expectSame = [&](double t) {
    const Energy a = energyAt(sleeping, t);
    const Energy b = energyAt(waking, t);
    EXPECT_NEAR(a.applied, b.applied, 1e-7 * std::abs(b.applied)) << t;
    EXPECT_NEAR(a.reactions, b.reactions, 1e-7 * std::abs(b.reactions)) << t;
    EXPECT_GT(std::abs(b.applied_power), 1.0);
  };
  expectSame(250.0);
  expectSame(300.0);
  sleeping.command(0, 20.0);
  waking.command(0, 20.0);
  expectSame(301.5);
  expectSame(320.0);
}

// --- the doubt --------------------------------------------------------------------------------
/// Advances to `end` and returns the first sampled time at which the reactions had more than 5 % of
/// the integral of sum |Q omega|, or -1.
double findDoubt(const Scene& scene, double end, EnergyDoubt* doubt) {
  Simulation simulation = tracked(scene);
  double throughput = 0.0;
  double before = 0.0;
  double since = -1.0;
  constexpr double kInterval = 1e-3;
  for (int n = 0; n * kInterval <= end; ++n) {
    const Energy energy = energyAt(simulation, n * kInterval);
    const Sample& sample = simulation.sample();
    double through = 0.0;
    for (int i = 0; i < scene.shaftCount(); ++i) {
      through += std::abs(sample.applied_torque[i] * sample.velocity[i]);
    }
    if (n > 0) throughput += 0.5 * kInterval * (before + through);
    before = through;
    if (since < 0.0 && n > 0 && std::abs(energy.reactions) > 0.05 * throughput) {
      since = n * kInterval;
    }
  }
  *doubt = simulation.energyDoubt();
  return since;
}

TEST(EnergyDoubt, ComesWhenTheReactionsHaveFivePercent) {
  EnergyDoubt doubt;
  Scene scene = test::sceneFromText(kVaryingRatio);
  // The slip's own losses are small from a start without slip.
  const double since = findDoubt(scene, 20.0, &doubt);
  ASSERT_GT(since, 0.1);
  ASSERT_TRUE(doubt.exists());
  // It is looked for at the ends of steps.
  EXPECT_NEAR(doubt.since, since, 0.5);
  EXPECT_GT(doubt.throughput, 100.0);
  const std::string text = describe(doubt);
  for (const char* word : {"generalized_gauss", "null-space component", "doc/theory.md",
                           "principle: gauss", " J", "%"}) {
    EXPECT_NE(text.find(word), std::string::npos) << text;
  }
}

TEST(EnergyDoubt, IsThereWithoutTrackingAndGoesWithAReset) {
  Simulation simulation(test::sceneFromText(kVaryingRatio));
  EXPECT_FALSE(simulation.energyDoubt().exists());
  EXPECT_EQ(describe(simulation.energyDoubt()), "");
  simulation.advanceTo(20.0);
  const EnergyDoubt first = simulation.energyDoubt();
  EXPECT_TRUE(first.exists());
  simulation.reset();
  EXPECT_FALSE(simulation.energyDoubt().exists());
  // Not before its time, where the integrator may already be.
  simulation.advanceTo(std::nextafter(first.since, 0.0));
  EXPECT_FALSE(simulation.energyDoubt().exists());
  simulation.advanceTo(first.since);
  EXPECT_TRUE(simulation.energyDoubt().exists());
  simulation.advanceTo(20.0);
  EXPECT_EQ(simulation.energyDoubt().since, first.since);
}

// The reactions of the ship's drive feed it at first and take later: what is told holds when it is
// told.
TEST(EnergyDoubt, HoldsAtItsInstantAndGoesWhenTheShareFalls) {
  Simulation simulation(test::sceneFromFile(VARIATOR_SIM_TEST_DIR "/../config/ship.yaml"));
  int told = 0;
  int gone = 0;
  const std::map<int, double> commands = {{10, 25.0},   {100, 45.0}, {160, 10.0},
                                          {220, -20.0}, {280, 30.0}, {340, 0.0}};
  for (int n = 1; n <= 400; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.05 * n).ok());
    if (const auto command = commands.find(n); command != commands.end()) {
      simulation.command(0, command->second);
    }
    const EnergyDoubt doubt = simulation.energyDoubt();
    if (!doubt.exists()) {
      EXPECT_EQ(describe(doubt), "");
      gone += told > 0 ? 1 : 0;
      continue;
    }
    ++told;
    EXPECT_GT(std::abs(doubt.reactions), 0.05 * doubt.throughput) << describe(doubt);
    EXPECT_LE(doubt.since, doubt.time);
    EXPECT_LE(doubt.time, simulation.time());
    EXPECT_NE(describe(doubt).find(" J by t = "), std::string::npos) << describe(doubt);
  }
  EXPECT_GT(told, 10);
  EXPECT_GT(gone, 10);
}

TEST(EnergyDoubt, IsNoneOfTheClassicalPrinciple) {
  EnergyDoubt doubt;
  findDoubt(withPrinciple(test::sceneFromText(kVaryingRatio), Principle::kGauss), 20.0, &doubt);
  EXPECT_FALSE(doubt.exists());
}

TEST(EnergyDoubt, IsNoneWhereCStandsStill) {
  // The slip takes energy, as it is meant to; C could turn with the command, and does not.
  const std::string scene =
      test::sceneText("drive 0.8, load 2",
                      {"motor on drive: 1",
                       "variator = SlipRatio, shafts: [drive, load], time_constant: 2, ratio: "
                       "{topic: ratio, hold: zero_order, initial: 0.6}"},
                      "initial: {velocity: [20, 0]}");
  Simulation simulation = tracked(test::sceneFromText(scene));
  const Energy energy = energyAt(simulation, 4.0);
  EXPECT_LT(energy.reactions, -10.0);
  EXPECT_FALSE(simulation.energyDoubt().exists());
  // Now it does.
  simulation.command(0, 0.8);
  simulation.advanceTo(5.0);
  EXPECT_TRUE(simulation.energyDoubt().exists());

  EnergyDoubt doubt;
  EXPECT_GT(findDoubt(test::sceneFromText(kSlippingRest), 20.0, &doubt), 0.0);
  EXPECT_FALSE(doubt.exists());
}

}  // namespace
}  // namespace variator_sim
