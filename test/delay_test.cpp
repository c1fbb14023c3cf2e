// delay(x, T) in formulas (test/known_motions.yaml has motions by SciPy and in closed form).
#include "emit_c/emit_c.h"
#include "support/faults.h"
#include "support/machine_code_folder.h"
#include "support/played.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/trim.h"

namespace variator_sim {
namespace {

using test::sceneText;

Simulation simulate(const std::string& yaml) {
  return Simulation(test::sceneFromText(yaml));
}

double valueOf(Simulation& simulation, QuantityGroup group, std::size_t n) {
  std::vector<double> values(simulation.quantityNames(group).size());
  simulation.calcQuantities(group, values.data());
  return values.at(n);
}
double outputOf(Simulation& simulation, std::size_t n = 0) {
  return valueOf(simulation, QuantityGroup::kOutputs, n);
}

/// One shaft of unit inertia.
std::string oneShaft(const std::string& formula, const std::string& keys = "") {
  return sceneText("a 1", {"law on a: " + formula}, keys);
}

// At the start the delayed value is that of the projected velocity.
TEST(Delay, BeginsWithTheValueOfTheFirstState) {
  Simulation simulation = simulate(sceneText(
      "a 1, b 1", {"law on a: -delay(w_b, 3)", "gear = KinematicRatio, shafts: [a, b], ratio: 2"},
      "outputs: [then]\nthen: {expression: \"delay(w_b, 3)\"}\n"
      "initial: {velocity: [5, 0], project: true}"));
  const double first = simulation.sample().velocity[1];
  EXPECT_GT(std::abs(first), 1.0);
  EXPECT_EQ(outputOf(simulation), first);
  ASSERT_TRUE(simulation.advanceTo(2.0).ok());
  EXPECT_EQ(outputOf(simulation), first);
  EXPECT_EQ(simulation.sample().applied_torque[0], -first);
}

const std::string kClutch =
    sceneText("a 1, b 2",
              {"drive on a: 20*(1 - 0.05*delay(w_b, 0.3)) - 2*delay(slip, 0.2) + delay(u, 0.15)",
               "clutch = Clutch, shafts: [a, b], capacity: '8 + 2*sin(delay(phi_b, 0.1))'",
               "drag on b: -0.1*w_b"},
              "inputs: [u]\nu: {topic: u, hold: first_order_lag, time_constant: 0.1}\n"
              "states: [slip]\nslip: {rate: \"delay(w_a - w_b, 0.7) - slip\"}\n"
              "initial: {velocity: [10, 0]}");

TEST(Delay, SavedWithItsPastGoesOnToTheBit) {
  Simulation saved = simulate(kClutch);
  ASSERT_TRUE(saved.advanceTo(3.3).ok()) << saved.describeStatus();
  MotionState state;
  ASSERT_TRUE(saved.saveState(&state));
  Simulation restored = simulate(kClutch);
  const MotionState read = readMotionState(
      readYamlText(toYaml(toTree(state, saved.scene())), "state"), saved.scene(), state);
  ASSERT_EQ(restored.setState(read, false), "");
  for (int n = 0; n < 30; ++n) {
    for (Simulation* it : {&saved, &restored}) {
      if (n == 7) it->command(0, 5.0);
      ASSERT_TRUE(it->advanceTo(3.3 + 0.1 * n).ok());
    }
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(saved.sample().velocity[i], restored.sample().velocity[i]) << n;
      EXPECT_EQ(saved.sample().acceleration[i], restored.sample().acceleration[i]) << n;
    }
  }
  state.history.past.pop_back();
  EXPECT_NE(restored.setState(state, false), "") << "a past is missing";
  EXPECT_TRUE(restored.advanceTo(7.0).ok()) << restored.describeStatus();
}

/// (No input is there but the delayed formula.)
TEST(Delay, OfASceneWithoutInputsGoesOnFromItsSavedState) {
  const std::string scene = oneShaft("sin(t) - delay(w_a, 0.3)");
  Simulation saved = simulate(scene);
  ASSERT_TRUE(saved.advanceTo(1.1).ok());
  MotionState state;
  ASSERT_TRUE(saved.saveState(&state));
  Simulation restored = simulate(scene);
  const MotionState read = readMotionState(
      readYamlText(toYaml(toTree(state, saved.scene())), "state"), saved.scene(), MotionState{});
  ASSERT_EQ(restored.setState(read, false), "");
  for (Simulation* it : {&saved, &restored}) ASSERT_TRUE(it->advanceTo(3.0).ok());
  EXPECT_EQ(saved.sample().velocity[0], restored.sample().velocity[0]);
}

class DelayByMachineCode : public test::MachineCodeFolder {};

TEST_F(DelayByMachineCode, IsTheInterpretersToTheBit) {
  const std::string interpreted = test::play(test::sceneFromText(kClutch), -1);
  EXPECT_EQ(interpreted, test::play(test::sceneFromText(kClutch), 0));
  EXPECT_EQ(interpreted, test::play(test::sceneFromText(kClutch), 17));
}

// Each end of a step ends others a delay later, and two delays multiply them: pieces that go on
// into the next one keep steps from becoming ever shorter.
TEST(Delay, OfSeveralTimesKeepsTheLengthOfSteps) {
  Simulation simulation =
      simulate(oneShaft("sin(3*t) - delay(w_a, 0.5) - 0.5*delay(phi_a, 0.7071)"));
  ASSERT_TRUE(simulation.advanceTo(50.0).ok()) << simulation.describeStatus();
  const std::uint64_t first = simulation.statistics().steps;
  ASSERT_TRUE(simulation.advanceTo(500.0).ok()) << simulation.describeStatus();
  EXPECT_LT(simulation.statistics().steps, 12U * first);
}

TEST(Delay, WhosePastIsTooLongStopsByName) {
  Simulation simulation =
      simulate(oneShaft("-1e6*phi_a + 0*delay(w_a, 1000)", "initial: {velocity: [1]}"));
  EXPECT_FALSE(simulation.advanceTo(500.0).ok());
  for (const char* words : {"the past of 'delay(w_a, 1000)'", "16384", "shorter delay"})
    EXPECT_NE(simulation.describeStatus().find(words), std::string::npos)
        << simulation.describeStatus();
}

TEST(Delay, IsRefusedByNameWhereThereIsNoPast) {
  const std::string yaml = oneShaft("-delay(w_a, 0.04)");
  const auto expectFault = [](const auto& run) {
    test::expectRefused("law", {"'delay(w_a, 0.04)'", "rate: (x - z)/0.04"}, [&] { run(); });
  };
  Simulation simulation = simulate(yaml);
  expectFault([&] { (void)emitScene(simulation, "scene", "scene"); });
  expectFault([&] { (void)trim(simulation.scene(), {}); });
}

TEST(Delay, IsNoNamedInput) {
  Simulation simulation = simulate(sceneText(
      "a 1", {"law on a: -delay(w_a, 0.2)", "motor = CommandedTorque, shaft: a, topic: motor"}));
  simulation.command(1, 3.0);
  EXPECT_EQ(simulation.quantityNames(QuantityGroup::kInputs), std::vector<std::string>{"motor"});
  EXPECT_EQ(valueOf(simulation, QuantityGroup::kInputs, 0), 3.0);
  EXPECT_EQ(simulate(oneShaft("delay(w_a, 2)/(1 + delay(w_a, 2)^10)")).scene().inputCount(), 1)
      << "one past serves both";
}

TEST(Delay, IsKeptByEveryStepper) {
  const std::string yaml = oneShaft("-delay(w_a, 1)", "initial: {velocity: [1]}");
  for (const char* stepper : {"auto", "taylor", "radau", "dopri5", "fehlberg78",
                              "taylor_fixed, step: 0.01", "rk4, step: 0.01"}) {
    Simulation simulation = simulate(yaml + "solver: {stepper: " + stepper + "}\n");
    ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << stepper << simulation.describeStatus();
    // w = 1 - t up to 1 s, then w' = t - 2.
    EXPECT_NEAR(simulation.sample().velocity[0], -0.5, 1e-8) << stepper;
  }
}

}  // namespace
}  // namespace variator_sim
