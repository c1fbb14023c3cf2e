// Stop messages whose values help (test/known_motions.yaml has the words of all).

#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::sceneText;

/// A motor that swings at 100 rad/s, a clutch of 80 N m, regularized within `speed`, rad/s, a hub
/// on a spring, and a car.
std::string withDryClutch(const std::string& speed) {
  return sceneText(
      "flywheel 1, hub 0.05, car 1",
      {"motor on flywheel: 200*sin(100*t)",
       "clutch = Friction, shafts: [flywheel, hub], coulomb: 80, regularization_speed: " + speed,
       "spring = ElasticCoupling, shafts: [hub, car], stiffness: 160, damping: 1"},
      "principle: gauss\ninitial: {velocity: [100, 90, 90]}");
}

/// How the scene's motion stops until `end`; "" where it does not.
std::string stopOf(const std::string& scene, double end) {
  Simulation simulation(test::sceneFromText(scene));
  simulation.advanceTo(end);
  return simulation.describeStatus();
}

void expectText(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << part << " is not in\n" << text;
}
void expectNoText(const std::string& text, const std::string& part) {
  EXPECT_EQ(text.find(part), std::string::npos) << part << " is in\n" << text;
}

// A gear that is chosen by the speed alone: as the hint says, it runs, and settles between.
TEST(Chattering, TheHintForAnIfRuns) {
  const auto wheel = [](const std::string& gear) {
    return sceneText(
        "wheel 163",
        {"engine on wheel: 200*(" + gear + ")", "road on wheel: -2*w_wheel*abs(w_wheel)"},
        "principle: gauss");
  };
  expectText(stopOf(wheel("if(w_wheel < 30, 12.6, 7.7)"), 60.0), "torque 'engine'");
  Simulation smooth(
      test::sceneFromText(wheel("7.7 + (12.6 - 7.7)*(1 - tanh((w_wheel - 30)/0.5))/2")));
  EXPECT_TRUE(smooth.advanceTo(60.0).ok()) << smooth.describeStatus();
  EXPECT_NEAR(smooth.sample().velocity[0], 30.0, 1.0);
}

// --- ToleranceTooSmall -----------------------------------------------------------------------

TEST(ToleranceTooSmall, NamesTheNumberOfTheSteepestLawAndAValueThatWouldDo) {
  const std::string text = stopOf(withDryClutch("1e-6"), 0.3);
  expectText(text, "ToleranceTooSmall at t = ");
  expectText(text, "most by torque 'clutch': 'clutch/regularization_speed: ");
  expectText(text, "(it is 1e-06)");
  expectText(text, "'principle: generalized_gauss'");
  expectText(text, "without a constraint both principles give the same motion");
  expectNoText(text, "coulomb");
  const auto valueBehind = [&text](const std::string& key) {
    const std::size_t begin = text.find("'" + key + ": ") + key.size() + 3;
    return text.substr(begin, text.find('\'', begin) - begin);
  };
  const std::string speed = valueBehind("clutch/regularization_speed");
  EXPECT_EQ(stopOf(withDryClutch(speed), 0.3), "") << speed;
  EXPECT_EQ(stopOf(withDryClutch("1e-6") +
                       "solver: {relative_tolerance: " + valueBehind("solver/relative_tolerance") +
                       ", absolute_tolerance: " + valueBehind("solver/absolute_tolerance") + "}\n",
                   0.3),
            "");
}

// --- StepLimit ------------------------------------------------------------------------------

TEST(StepLimit, NamesTheFastestLawAndHowManyStepsWouldDo) {
  const std::string scene = sceneText("a 1, b 1", {"slow on a: -w_a", "fast on b: 5*sin(2000*t)"}) +
                            "solver: {stepper: dopri5, maximum_steps: ";
  const std::string text = stopOf(scene + "200}\n", 1.0);
  expectText(text, "StepLimit at t = ");
  expectText(text, "fastest changes torque 'fast'");
  const std::string key = "'solver/maximum_steps: ";
  expectText(text, key);
  const std::size_t begin = text.find(key) + key.size();
  const std::string steps = text.substr(begin, text.find('\'', begin) - begin);
  EXPECT_EQ(stopOf(scene + steps + "}\n", 1.0), "");
}

// --- on load ---------------------------------------------------------------------------------

TEST(Friction, WarnsOfAStaticTorqueThatIsNeverReached) {
  const auto warningsOf = [](const std::string& numbers) {
    return test::sceneFromText("a 1",
                               {"hold = Friction, shaft: a, coulomb: 1, static: 1.5, " + numbers})
        .warnings;
  };
  const auto warnings = warningsOf("stribeck_speed: 0.01, regularization_speed: 0.01");
  ASSERT_EQ(warnings.size(), 1U);
  expectText(warnings[0], "hold/static: 1.5 N m are never reached, the torque's peak is 1 N m");
  expectText(warnings[0], "'hold/regularization_speed: 0.0003' comes near");
  EXPECT_TRUE(warningsOf("stribeck_speed: 0.01, regularization_speed: 0.0003").empty());
  EXPECT_EQ(warningsOf("stribeck_speed: 0.05, regularization_speed: 0.01").size(), 1U);
  EXPECT_TRUE(warningsOf("stribeck_speed: 0.1, regularization_speed: 0.01").empty());
}

}  // namespace
}  // namespace variator_sim
