// Stop messages: the element at fault, its number, and a value that helps.

#include "support/clutch.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::sceneText;

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

// --- NonFiniteValue --------------------------------------------------------------------------

// Accelerations that are not finite make the rate of every torque so that reads a speed.
TEST(NonFiniteValue, BlamesTheTorqueThatMakesItAndNotWhatReadsTheAccelerations) {
  for (const char* principle : {"gauss", "generalized_gauss"}) {
    std::vector<std::string> torques = {"engine on pump: 30 - 0.1*w_pump",
                                        "fluid on pump: -w_turbine/w_pump"};
    for (const bool swapped : {false, true}) {
      if (swapped) std::swap(torques[0], torques[1]);
      const std::string text = stopOf(
          sceneText("pump 1.5, turbine 3.2", torques, std::string("principle: ") + principle), 1.0);
      expectText(text, "NonFiniteValue at t = 0 s");
      expectText(text, "torque 'fluid', its w_turbine/w_pump;");
      expectNoText(text, "'engine'");
    }
  }
}

// The rate of a root is infinite where the root is 0; that of `late`, which is to blame, comes
// from its value.
TEST(NonFiniteValue, AValueIsToBlameBeforeARate) {
  const std::string text = stopOf(
      sceneText("a 1", {"root on a: sqrt(phi_a)", "late on a: 2*log(w_a)"}, "principle: gauss"),
      1.0);
  expectText(text, "torque 'late', its log(w_a)");
}

TEST(NonFiniteValue, NamesThePartJustAhead) {
  const std::string text =
      stopOf(sceneText("a 1", {"motor on a: 4 + w_a", "load on a: -0.1*sqrt(5 - w_a)"}), 10.0);
  expectText(text, "NonFiniteValue at t = ");
  expectText(text, "torque 'load', its sqrt(5 - w_a)");
}

TEST(NonFiniteValue, BlamesAConstraintThatHasNoValue) {
  const std::string text = stopOf(
      sceneText("a 1, b 1", {"m on a: 1 - w_a", "ratio: e_b - e_a/w_a"}, "principle: gauss"), 1.0);
  expectText(text, "constraint 'ratio', its ");
  expectNoText(text, "torque 'm'");
}

// --- Chattering ------------------------------------------------------------------------------

std::string chatteringOf(const std::string& torque) {
  return stopOf(sceneText("a 1", {"push on a: 2 - 0.1*w_a", "hold on a: " + torque},
                          "initial: {velocity: [1]}\nprinciple: gauss"),
                10.0);
}

TEST(Chattering, HintsAtWhatSuitsTheFunction) {
  const std::string by_if = chatteringOf("if(w_a < 3, 1, -9)");
  expectText(by_if, "Chattering at t = ");
  expectText(by_if, "torque 'hold'");
  expectText(by_if,
             "no memory for a hysteresis: blend them over a width, b + (a - b)*(1 - tanh((x "
             "- y)/width))/2 for if(x < y, a, b)");
  expectNoText(by_if, "Friction");
  expectNoText(by_if, "abs(x)");
  const std::string by_sign = chatteringOf("-9*sign(w_a - 3)");
  expectText(by_sign, "tanh(w/0.01) for sign(w), variator_sim/Friction for dry friction");
  expectNoText(by_sign, "'if'");
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
  const std::string text = stopOf(test::withDryClutch("1e-6"), 0.3);
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
  EXPECT_EQ(stopOf(test::withDryClutch(speed), 0.3), "") << speed;
  EXPECT_EQ(stopOf(test::withDryClutch("1e-6") +
                       "solver: {relative_tolerance: " + valueBehind("solver/relative_tolerance") +
                       ", absolute_tolerance: " + valueBehind("solver/absolute_tolerance") + "}\n",
                   0.3),
            "");
}

// The same law as a formula: its parameter is a key of the scene, too.
TEST(ToleranceTooSmall, NamesTheParameterOfAFormula) {
  const std::string text = stopOf(test::withClutch(R"yaml(clutch:
  type: variator_sim/ExpressionTorque
  shaft: flywheel
  reaction_on: hub
  torque: "-height*tanh((w_flywheel - w_hub)/width)"
  parameters: {height: 80, width: 1e-6}
)yaml"),
                                  0.3);
  expectText(text, "most by torque 'clutch': 'clutch/parameters/width: ");
}

// --- StepUnderflow, StepLimit ----------------------------------------------------------------

TEST(StepUnderflow, NamesTheTorqueThatRunsAway) {
  const std::string text = stopOf(
      sceneText("a 1, b 1", {"brake on a: 3 - w_a", "blast on b: 1/(1 - t)^0.5 - 100*w_b"}), 2.0);
  expectText(text, "torque 'blast'");
  expectNoText(text, "torque 'brake'");
}

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

// --- scenes that are stepped by their program alone --------------------------------------------

TEST(BesideABrake, StopsNameTheElementAndAWayOut) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> stops = {
      {"1 - 3*sign(w_a)", {"Chattering", "tanh(w/0.01) for sign(w)", "torque 'q'"}},
      {"sqrt(w_a - 1)", {"NonFiniteValue", "torque 'q', its 0.5*e_a/sqrt(w_a - 1)"}},
      {"w_a^2", {"StepUnderflow", "ever faster", "the shafts run away, driven by torque 'q'"}},
      {"w_a*abs(w_a)",
       {"StepUnderflow", "ever faster", "the shafts run away, driven by torque 'q'"}},
      {"100*cos(5e4*t)", {"StepLimit", "'solver/maximum_steps: ", "fastest changes torque 'q'"}}};
  for (const auto& [torque, words] : stops) {
    const std::string text = stopOf(
        sceneText("a 1, spare 1", {"q on a: " + torque, "brake = Brake, shaft: spare, capacity: 5"},
                  "initial: {velocity: [1, 0]}\nsolver: {maximum_steps: 1000}"),
        3.0);
    for (const std::string& word : words) expectText(text, word);
  }
}

/// Returns the message of a start beside a brake: of a stop at once, or of a refusal.
std::string startBesideABrake(const std::string& torque, const std::string& psi,
                              const std::string& velocity) {
  const std::string scene = sceneText(
      "a 1, b 2, spare 1",
      {"q on a: " + torque, "brake = Brake, shaft: spare, capacity: 5",
       std::string("belt of order ") + (psi.find('e') == std::string::npos ? "1: " : "2: ") + psi},
      "verify_derivatives: false\ninitial: {velocity: " + velocity + "}");
  try {
    return stopOf(scene, 0.1);
  } catch (const SceneError& error) {
    return error.keyPath() + ": " + error.what();
  }
}

TEST(BesideABrake, StartsTellTheirFaultAndAWayOut) {
  EXPECT_EQ(startBesideABrake("1", "w2 - 0.5*w1", "[2, 1, 0]"), "");
  const std::string moved = startBesideABrake("1", "w2 - 0.5*w1", "[2, 3, 0]");
  expectText(moved, "initial/velocity: ");
  expectText(moved,
             "[2, 3, 0] does not satisfy the constraints: residual of 'belt' = 2; "
             "consistent velocities near them are [3.33333333333333");
  expectText(moved, "'initial/project: true'");
  expectText(startBesideABrake("1", "w1^2 + w2^2 + 4", "[2, 3, 0]"),
             "no velocities that satisfy the constraints were found near those given");
  const std::string undefined = startBesideABrake("log(w_a)", "e2 - e1", "[0, 1, 0]");
  expectText(undefined, "NonFiniteValue at t = 0 s");
  expectText(undefined, "torque 'q', its log(w_a)");
  const std::string singular = startBesideABrake("1", "t*(e2 - e1)", "[2, 1, 0]");
  expectText(singular, "SingularConstraint at t = 0 s");
  expectText(singular, "constraint 'belt'");
}

// Points (x, x^2) of stationary distance from (t - 1, 2): 2 x^3 - 3 x = t - 1. The least, x < 0,
// meets another one at x = -1/sqrt(2), t = 1 + sqrt(2); no tolerance leads further on its branch.
TEST(SolutionsThatMeet, AreTold) {
  const std::string scene =
      "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 1}\ntorques: [p, q]\n"
      "p: {type: variator_sim/ExpressionTorque, shaft: a, torque: t - 1}\n"
      "q: {type: variator_sim/ExpressionTorque, shaft: b, torque: 2}\nconstraints: [c]\n"
      "c: {type: variator_sim/ExpressionConstraint, order: 2, expression: e_b - e_a^2}\n"
      "principle: gauss\n";
  // An event is no reason for another answer.
  const std::string events =
      "variables: [n]\nn: {initial: 0}\nevents: [e]\ne: {when: t - 1, set: {n: 1}}\n";
  for (const std::string& more : {std::string(), events}) {
    const std::string text = stopOf(scene + more, 5.0);
    expectText(text, "ProjectionFailed at t = 2.414");
    expectText(text, "two solutions for the accelerations meet here");
  }
}

}  // namespace
}  // namespace variator_sim
