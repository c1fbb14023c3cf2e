// Motions that crawled: each has a slow motion that some stepper follows in a few steps. `auto`
// takes at most three times as many as the best stepper by name, and none takes thousands.

#include <cstddef>

#include "support/clutch.h"
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

// Rounding of 94 rad/s makes 1e-8 rad/s^2 of the accelerations, which is nothing beside the
// torques that balance each other in them.
TEST(Crawls, AClutchWhoseTorquesCancelKeepsItsTolerance) {
  const Played regularized =
      run(test::sceneFromText(test::withDryClutch("1e-3")), StepperKind::kAuto, 0.45);
  ASSERT_TRUE(regularized.status.ok()) << regularized.text;
  // A dry clutch that locks and slips by events.
  EXPECT_NEAR(regularized.sample.velocity[0], 94.66966463, 2e-3);
  EXPECT_NEAR(regularized.sample.velocity[2], 96.04620816, 2e-3);
  EXPECT_LT(regularized.tried(), 1500U);
  const Played narrow =
      run(test::sceneFromText(test::withDryClutch("1e-4")), StepperKind::kAuto, 0.45, 10000);
  EXPECT_TRUE(narrow.status.ok()) << narrow.text;
}

// A lag that moves drives nothing here, but for what a law reads of it: a motion that stands still
// in a steep layer may read the time, too.
TEST(Crawls, AShaftThatFrictionStopsWhileAnInputMoves) {
  for (const std::string& principle : kPrinciples) {
    for (const char* const width : {"1e-6", "1e-7", "1e-8"}) {
      Scene scene = test::sceneFromText(
          "inputs: [u]\nu: {topic: u, hold: first_order_lag, time_constant: 1}\n" +
          shaft("1", std::string("100*if(u<1,1,2)-400*clamp(w1/") + width + ",-1,1)", 1e-8,
                principle));
      scene.solver.maximum_steps = kMostSteps;
      Simulation simulation(test::withTolerance(scene, 1e-4));
      simulation.command(0, 1.0);
      EXPECT_TRUE(simulation.advanceTo(1.0).ok()) << width << simulation.describeStatus();
      const Statistics& counts = simulation.statistics();
      EXPECT_LT(counts.steps + counts.rejected_steps, 1500U) << principle << ' ' << width;
      EXPECT_NEAR(simulation.sample().velocity[0], 0.0, 1e-5);
    }
  }
}

// The fan begins to turn. The polynomial through a long step is less exact than its speed is large
// then, and seems to pass 0.
TEST(Crawls, AShaftThatBeginsToTurn) {
  for (const double tolerance : {1e-4, 1e-8, 1e-9, 1e-10}) {
    Simulation simulation(test::withTolerance(application("starting_system"), tolerance));
    simulation.advanceTo(1.0);
    simulation.command(0, 1.0);
    ASSERT_TRUE(simulation.advanceTo(20.0).ok()) << simulation.describeStatus();
    EXPECT_LT(simulation.statistics().steps + simulation.statistics().rejected_steps, 500U)
        << tolerance;
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

// A freewheel lets go, and two corners of the coupling's damping begin on their points: neither is
// in the way of the other.
TEST(Crawls, AFreewheelLetsGoInsideAGap) {
  for (const char* const inertia : {"2", "1e6"}) {
    for (const std::string& principle : kPrinciples) {
      const std::string J = inertia;
      const Played played =
          run(test::sceneFromText(
                  "a " + J + ", b " + J,
                  {"m on a: cos(t)*" + J,
                   "sp = ElasticCoupling, shafts: [a, b], stiffness: 1, damping: 1, gap: 0.2",
                   "ow = OneWayClutch, shafts: [a, b]"},
                  "principle: " + principle),
              StepperKind::kAuto, 5.0);
      ASSERT_TRUE(played.status.ok()) << played.text;
      EXPECT_LT(played.tried(), 200U);
      EXPECT_NEAR(played.sample.velocity[0] + played.sample.velocity[1], std::sin(5.0), 1e-7);
    }
  }
}

// A brake at the edge of its capacity lets a shaft off its stop while implicit steps are made: the
// first coefficients of polynomials through stages do not tell to which side it goes.
TEST(Crawls, ABrakeLetsAShaftOffItsStop) {
  const std::string file = std::string(VARIATOR_SIM_TEST_DIR) + "/scenes/brake_on_a_stop.yaml";
  for (const double tolerance : {1e-8, 1e-10, 1e-11, 1e-12}) {
    const Played played =
        run(test::withTolerance(test::sceneFromFile(file), tolerance), StepperKind::kAuto, 20.0);
    ASSERT_TRUE(played.status.ok()) << played.text;
    EXPECT_NEAR(played.sample.angle[0], -0.1, 1e-12) << tolerance;
  }
}

// A reserve that is 0 but for the rounding of its last coefficients is known over the whole step.
TEST(Crawls, ClutchesThatHoldNothingAtRest) {
  const std::string file = std::string(VARIATOR_SIM_TEST_DIR) + "/scenes/two_clutches_at_rest.yaml";
  for (const double tolerance : {1e-6, 1e-7, 1e-9}) {
    const Played played =
        run(test::withTolerance(test::sceneFromFile(file), tolerance), StepperKind::kAuto, 1.0);
    ASSERT_TRUE(played.status.ok()) << played.text;
    EXPECT_NEAR(played.sample.velocity[0], -0.23856130042, 20.0 * tolerance) << tolerance;
  }
}

// Rounding of speeds of 500 rad/s moves the torque of what slips by 1e-7 rad/s: what it stirs up in
// each step by series is no motion that these have to follow.
TEST(Crawls, AContactStirredUpByRounding) {
  const Played played = run(test::sceneFromText(R"(
shafts: [a, b]
a: {inertia: 1.0}
b: {inertia: 2.0}
torques: [load, contact]
load: {type: variator_sim/ExpressionTorque, shaft: a, torque: "399.6"}
contact: {type: variator_sim/ExpressionTorque, shaft: a, torque: '-400*tanh((w1-w2)/1e-7)', reaction_on: b}
initial: {velocity: [500, 500]}
solver: {relative_tolerance: 1e-9, absolute_tolerance: 1e-9}
)"),
                            StepperKind::kAuto, 3.0);
  EXPECT_TRUE(played.status.ok()) << played.text;
  EXPECT_NEAR(played.sample.velocity[1], 500.0 + 399.6, 1e-5);
}

// Rounding of angles of 300 rad makes torques of 5e-7 N m, far more than the tolerance of the
// accelerations: no step, however short, has less.
TEST(Crawls, StepsByRadauWithinTheRoundingOfAngles) {
  const Scene scene = test::sceneFromText(R"(
shafts: [a, b, c, d]
a: {inertia: 1.0}
b: {inertia: 2.0}
c: {inertia: 3.0}
d: {inertia: 1.0}
torques: [drive, ab, cd, drag]
drive: {type: variator_sim/ExpressionTorque, shaft: a, torque: '50*sin(2*t)'}
ab: {type: variator_sim/ElasticCoupling, shafts: [a, b], stiffness: 2.0e+6, damping: 2.0e+4}
cd: {type: variator_sim/ElasticCoupling, shafts: [c, d], stiffness: 2.0e+6, damping: 2.0e+4}
drag: {type: variator_sim/Friction, shaft: d, viscous: 0.3}
constraints: [variator]
variator: {type: variator_sim/KinematicRatio, shafts: [b, c], ratio: '1 + 0.3*sin(t + 1)'}
initial: {angle: [300, 300, 300, 300]}
solver: {relative_tolerance: 1e-10, absolute_tolerance: 1e-10}
)");
  const Played chosen = run(scene, StepperKind::kAuto, 3.0);
  const Played played = run(scene, StepperKind::kRadau, 3.0);
  EXPECT_TRUE(played.status.ok()) << played.text;
  // (R keeps what rounding adds to it in each step.)
  for (int i = 0; i < 4; ++i)
    EXPECT_NEAR(played.sample.velocity[i], chosen.sample.velocity[i], 1e-5);
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
