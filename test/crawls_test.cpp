// Motions that crawled: each has a slow motion that some stepper follows in a few steps. `auto`
// takes at most three times as many as the best stepper by name, and none takes thousands.

#include <cstddef>

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr int kMostSteps = 2000;  // of one second: more is a crawl

struct Played {
  MotionStatus status;
  std::string text;
  Sample sample;
  Statistics statistics;
  std::uint64_t tried() const { return statistics.steps + statistics.rejected_steps; }
};

Played run(Scene scene, StepperKind stepper, double end, int most_steps = kMostSteps) {
  scene.solver.maximum_steps = most_steps;
  Simulation simulation(test::withStepper(scene, stepper));
  Played result;
  result.status = simulation.advanceTo(end);
  result.text = simulation.describeStatus();
  result.sample = simulation.sample();
  result.statistics = simulation.statistics();
  return result;
}

/// Runs to `end` by `auto` and by name, and compares their steps. Returns what `auto` came to.
Played expectNoCrawl(const std::string& yaml, double end) {
  SCOPED_TRACE(yaml);
  const Scene scene = test::sceneFromText(yaml);
  Played chosen = run(scene, StepperKind::kAuto, end);
  EXPECT_TRUE(chosen.status.ok()) << chosen.text;
  std::uint64_t best = kMostSteps;
  for (const StepperKind kind :
       {StepperKind::kRadau, StepperKind::kFehlberg78, StepperKind::kTaylor}) {
    if (!test::takes(scene, kind)) continue;
    const Played named = run(scene, kind, end, kMostSteps / 4);
    if (!named.status.ok()) continue;
    best = std::min(best, named.tried());
    for (int i = 0; i < scene.shaftCount(); ++i) {
      EXPECT_NEAR(named.sample.velocity[i], chosen.sample.velocity[i], 1e-6);
    }
  }
  // (Implicit steps of the program have 5 stages, those by name up to 7; each costs less than
  // half.)
  EXPECT_LE(chosen.tried(), 4 * best + 100) << "of the best one by name: " << best;
  EXPECT_LT(chosen.tried(), 1500U);
  return chosen;
}

Scene application(const std::string& name) {
  return test::sceneFromFile(VARIATOR_SIM_TEST_DIR "/../config/applications/" + name + ".yaml");
}

void command(Simulation& simulation, const std::string& topic, double value) {
  const Scene& scene = simulation.scene();
  for (int i = 0; i < scene.inputCount(); ++i) {
    if (scene.inputs[static_cast<std::size_t>(i)].topic == topic) simulation.command(i, value);
  }
}

const std::vector<std::string> kWidths{"1e-2", "1e-3", "1e-4", "1e-5", "1e-6", "1e-7"};
const std::vector<std::string> kPrinciples{"gauss", "generalized_gauss"};

std::string shaft(const std::string& inertia, const std::string& torque, double velocity,
                  const std::string& principle) {
  return test::sceneText(
      "a " + inertia, {"q on a: " + torque},
      "initial: {velocity: " + test::list({velocity}) + "}\nprinciple: " + principle);
}

// Rest in a layer of friction, whatever stands beside it: an edge that rounding crosses again and
// again, one in time, a drive that the friction holds.
TEST(Crawls, AShaftThatFrictionStops) {
  for (const std::string& w0 : kWidths) {
    for (const char* const inertia : {"0.002", "50"}) {
      const std::string tanh = "tanh(w1/" + w0 + ")";
      for (const std::string& law : std::vector<std::string>{
               "-" + tanh, "0.3-" + tanh, "-if(w1>0,2*" + tanh + "," + tanh + ")",
               "-if(t<0.5,1,1.6)*" + tanh}) {
        expectNoCrawl(shaft(inertia, law, 3.0, "gauss"), 2.0);
      }
      expectNoCrawl(shaft(inertia, "-" + tanh, 3.0, "generalized_gauss"), 2.0);
    }
  }
}

// Slow drives: the shaft creeps with what the friction answers, or slips and sticks.
TEST(Crawls, AShaftThatASlowTorqueDrives) {
  for (const std::string& w0 : kWidths) {
    const std::string creeps = "0.5*sin(t)-tanh(w1/" + w0 + ")";
    expectNoCrawl(shaft("1", creeps, 0.0, "gauss"), 2.0);
    expectNoCrawl(shaft("0.002", creeps, 0.0, "gauss"), 2.0);
    for (const std::string& principle : kPrinciples) {
      expectNoCrawl(shaft("1", "1.5*sin(3*t)-tanh(w1/" + w0 + ")", 0.0, principle), 2.0);
      if (std::stod(w0) < 1e-6 && principle != "gauss") continue;
      expectNoCrawl(
          shaft("1", "1.2*sin(3*t)-(1+0.3*exp(-(w1/0.05)^2))*tanh(w1/" + w0 + ")", 0.0, principle),
          2.0);
    }
  }
}

// A mass on a belt sticks: its speed is that of the belt but for a creep, known in closed form.
TEST(Crawls, AMassThatSticksToABelt) {
  for (const std::string& w0 : kWidths) {
    for (const char* const stribeck : {"", ", static: 2, stribeck_speed: 0.05"}) {
      const std::string scene = test::sceneText(
          "belt 1, mass 1",
          {"spring on mass: -phi_mass",
           "friction = Friction, shafts: [belt, mass], coulomb: 1.5, regularization_speed: " + w0 +
               stribeck,
           "drive of order 1: w_belt - 0.2"},
          "principle: gauss\ninitial: {velocity: [0.2, 0.2]}");
      const Played sticks = expectNoCrawl(scene, 1.0);
      if (*stribeck != '\0' || std::stod(w0) > 1e-4) continue;
      const double creep = std::stod(w0) * std::atanh(0.2 / 1.5);
      EXPECT_NEAR(sticks.sample.velocity[1], 0.2 - creep, 1e-3 * creep + 1e-9);
      expectNoCrawl(scene, 10.0);
      const std::string gauss = "principle: gauss";
      std::string integrated = scene;
      integrated.replace(integrated.find(gauss), gauss.size(), "principle: generalized_gauss");
      expectNoCrawl(integrated, 10.0);
    }
  }
}

// A clutch behind a gear, whatever order holds that.
TEST(Crawls, AClutchBehindAGear) {
  for (const std::string& principle : kPrinciples) {
    for (const std::string& w0 : std::vector<std::string>{"1e-2", "1e-6"}) {
      for (const char* const drive : {"10-0.1*w_a", "3*sin(2*t)"}) {
        for (const char* const gear : {"gear of order 1: w_b-0.5*w_a", "gear: e_b-0.5*e_a",
                                       "gear: 0.01*(e_b-0.5*e_a)+w_b-0.5*w_a"}) {
          expectNoCrawl(
              test::sceneText(
                  "a 0.5, b 0.1, c 2",
                  {std::string("motor on a: ") + drive,
                   "clutch = Friction, shafts: [b, c], coulomb: 6, regularization_speed: " + w0,
                   "load on c: -0.02*w_c*abs(w_c)", gear},
                  "principle: " + principle),
              3.0);
        }
      }
    }
  }
}

// A command each 10 ms begins the motion anew: steps of its length are good, and nothing is
// learned by changing the stepper.
TEST(Crawls, CommandsEach10Milliseconds) {
  Simulation simulation(application("car"));
  for (int k = 0; k < 1000; ++k) {
    const double t = 0.01 * k;
    ASSERT_TRUE(simulation.advanceTo(t).ok()) << simulation.describeStatus();
    command(simulation, "throttle", 0.4 * (1.0 + 0.05 * std::sin(3.0 * t)));
    command(simulation, "clutch", 75.0 + 15.0 * t);
    command(simulation, "ratio", 0.07 + 0.02 * t);
  }
  const Statistics& counts = simulation.statistics();
  EXPECT_GT(counts.steps, 900U);
  EXPECT_LT(counts.steps, 3000U);
  EXPECT_LT(counts.rejected_steps, counts.steps);
  // "..; changed 700 times)"
  const std::string text = simulation.describeStepper();
  const std::size_t changed = text.find("changed ");
  if (changed != std::string::npos) {
    EXPECT_LT(std::stoi(text.substr(changed + 8)), 20) << text;
  }
}

// The clutch slips, and what is fast in it has died away. Of series so short only the last
// coefficients tell that; each command lets lags begin anew, for which steps before were too long.
TEST(Crawls, ASlippingClutchAtALooseTolerance) {
  for (const double tolerance : {1e-3, 3e-4, 1e-5}) {
    Simulation simulation(test::withTolerance(application("car"), tolerance));
    for (int k = 0; k < 20; ++k) {
      ASSERT_TRUE(simulation.advanceTo(1.0 + 2.0 * k).ok()) << simulation.describeStatus();
      command(simulation, "throttle", k % 2 == 0 ? 0.6 : 0.4);
      command(simulation, "clutch", 220.0);
      command(simulation, "ratio", 0.15);
    }
    EXPECT_LT(simulation.statistics().steps, 600U) << tolerance;
    EXPECT_LT(simulation.statistics().rejected_steps, 60U) << tolerance;
  }
}

// Steady running at a tolerance that rounding does not leave: where it refuses nearly all steps the
// motion goes on by other means.
TEST(Crawls, StepsThatRoundingRefuses) {
  Simulation simulation(test::withTolerance(application("starting_system"), 1e-13));
  command(simulation, "supply", 1.0);
  EXPECT_TRUE(simulation.advanceTo(26.0).ok()) << simulation.describeStatus();
  EXPECT_LT(simulation.statistics().rejected_steps, 500000U);
}

}  // namespace
}  // namespace variator_sim
