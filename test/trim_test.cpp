// Steady states: that they are some, how many there are, and what is said where there is none.
#include "variator_sim/trim.h"

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"
#include "variator_sim/linear_model.h"

namespace variator_sim {
namespace {

const std::string kScenes = std::string(VARIATOR_SIM_TEST_DIR) + "/../config/";

/// Two shafts that slip: `rest` has the principle and what else is to be said.
Scene slipping(const std::string& rest,
               const std::string& load = "-load_torque - 0.01*w_load*abs(w_load)") {
  return test::sceneFromText(
      "drive 0.8, load 2",
      {"motor on drive: 60*throttle - 0.1*w_drive", std::string("brake on load: ") + load,
       "variator: 0.2*(e_load - 0.6*e_drive)*(1 + 0.05*e_drive^2) + w_load - 0.6*w_drive"},
      std::string("inputs: [throttle, load_torque]\nthrottle: {topic: throttle, initial: 0.2, min: "
                  "0, max: 1}\nload_torque: {topic: load_torque, hold: first_order_lag, "
                  "time_constant: 0.2}\noutputs: [ratio]\nratio: {expression: "
                  "w_load/w_drive}\ninitial: {velocity: [40, 24]}\n") +
          rest);
}

/// A run from there stays there.
void expectSteady(Scene scene, const TrimState& state, double tolerance = 1e-7) {
  EXPECT_LE(state.residual, 1e-10);
  scene.initial = {state.point.angle, state.point.velocity, state.point.acceleration, false};
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) {
    scene.inputs[i].initial = state.point.input[i];
  }
  Simulation simulation(test::withTolerance(std::move(scene), 1e-11));
  ASSERT_TRUE(simulation.advanceTo(0.5).ok()) << simulation.describeStatus();
  for (std::size_t i = 0; i < state.point.velocity.size(); ++i) {
    const double expected = state.point.velocity[i] + 0.5 * state.point.acceleration[i];
    EXPECT_NEAR(simulation.sample().velocity[i], expected,
                tolerance * std::max(1.0, std::abs(expected)));
    EXPECT_NEAR(simulation.sample().acceleration[i], state.point.acceleration[i], 10 * tolerance);
  }
}

TEST(Trim, FindsWhatSuitsGivenSpeedsAndInputs) {
  for (const char* const principle : {"principle: generalized_gauss", "principle: gauss"}) {
    const Scene scene = slipping(principle);
    TrimOptions options;
    options.fix = {{"w_drive", 100.0}, {"throttle", 0.5}};
    options.free = {{"load_torque"}};
    const TrimResult result = trim(scene, options);
    ASSERT_EQ(result.states.size(), 1U) << result.message;
    const OperatingPoint& point = result.states[0].point;
    EXPECT_EQ(point.velocity[0], 100.0);
    EXPECT_NEAR(point.velocity[1], 60.0, 1e-10);
    // lambda (-0.6, 1) 0.2: R_drive = -0.6 R_load, 30 - 10 = 0.6 (load + 36)
    EXPECT_NEAR(point.input[1], 20.0 / 0.6 - 36.0, 1e-10);
    EXPECT_TRUE(result.states[0].undetermined.empty());
    expectSteady(scene, result.states[0]);
  }
}

TEST(Trim, FixesOutputsAndTorques) {
  TrimOptions options;
  options.fix = {{"outputs/ratio", 0.6}, {"drive/applied_torque", 5.0}};
  options.free = {{"throttle"}};
  const Scene scene = slipping("");
  const TrimResult result = trim(scene, options);
  ASSERT_EQ(result.states.size(), 1U) << result.message;
  const OperatingPoint& point = result.states[0].point;
  EXPECT_NEAR(60.0 * point.input[0] - 0.1 * point.velocity[0], 5.0, 1e-10);
  EXPECT_NEAR(point.velocity[1] / point.velocity[0], 0.6, 1e-10);
  expectSteady(scene, result.states[0]);
}

TEST(Trim, TellsOfMoreThanOne) {
  // An induction motor against a constant load: one speed on each side of the breakdown torque.
  const Scene scene = test::sceneFromText(
      "motor 0.8", {"kloss on motor: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)", "load on motor: -20"});
  Scene fast = scene;
  fast.initial.velocity = {46.0};
  EXPECT_GT(trim(fast, {}).states.at(0).point.velocity[0], 40.0);
  const TrimResult result = trim(scene, {});
  ASSERT_EQ(result.states.size(), 2U) << result.message;
  // s^2 - 0.6 s + 0.04 = 0
  const double root = std::sqrt(0.09 - 0.04);
  // The scene starts at 0.
  EXPECT_LT(result.states[0].point.velocity[0], result.states[1].point.velocity[0]);
  std::vector<double> speeds = {result.states[0].point.velocity[0],
                                result.states[1].point.velocity[0]};
  std::sort(speeds.begin(), speeds.end());
  EXPECT_NEAR(speeds[0], 50.0 * (1.0 - 0.3 - root), 1e-9);
  EXPECT_NEAR(speeds[1], 50.0 * (1.0 - 0.3 + root), 1e-9);
  EXPECT_NE(result.message.find("2 steady states"), std::string::npos) << result.message;
}

TEST(Trim, FindsStatesBesideThoseThatItKnows) {
  // Of the two branches of z the lower one has three speeds, the upper one has one.
  const TrimResult result = trim(
      test::sceneFromText("shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\ninputs: [u]\n"
                          "u: {topic: u, initial: 1.0, min: -50, max: 50}\ntorques: [m, l, s]\n"
                          "m: {type: variator_sim/ExpressionTorque, shaft: a, torque: "
                          "\"u-(w_a-1)*(w_a-3)*(w_a-6)-1+z\"}\n"
                          "l: {type: variator_sim/ExpressionTorque, shaft: b, torque: -0.5*w_b}\n"
                          "s: {type: variator_sim/Friction, shaft: b, coulomb: 0.1, "
                          "regularization_speed: 0.05}\nconstraints: [g]\n"
                          "g: {type: variator_sim/KinematicRatio, shafts: [a, b], ratio: 0.5}\n"
                          "principle: gauss\nstates: [z]\nz: {rate: 0.1*w_b - z + 0.05*z^2}\n"),
      {});
  std::vector<double> speeds;
  for (const TrimState& it : result.states) speeds.push_back(it.point.velocity[0]);
  std::sort(speeds.begin(), speeds.end());
  ASSERT_EQ(speeds.size(), 4U) << result.message;
  const double expected[] = {0.98771, 3.1, 5.96655, 6.83705};
  for (std::size_t n = 0; n < 4; ++n) EXPECT_NEAR(speeds[n], expected[n], n == 1 ? 0.1 : 1e-5);
  EXPECT_NE(result.message.find("may miss others"), std::string::npos) << result.message;
}

TEST(Trim, TellsOfNone) {
  // The ship's ratio sways with the time.
  const TrimResult ship = trim(test::sceneFromFile(kScenes + "ship.yaml"), {});
  EXPECT_TRUE(ship.states.empty());
  EXPECT_NE(ship.message.find("no steady state"), std::string::npos) << ship.message;

  TrimOptions options;
  options.fix = {{"w_drive", 100.0}};
  options.free = {{"throttle"}};
  const TrimResult limited = trim(slipping("", "-200"), options);
  EXPECT_TRUE(limited.states.empty());
  EXPECT_NE(limited.message.find("'throttle' would have to be 2.1666"), std::string::npos)
      << limited.message;
}

TEST(Trim, TellsOfInfinitelyMany) {
  TrimOptions options;
  options.free = {{"throttle"}};
  const TrimResult result = trim(slipping(""), options);
  ASSERT_EQ(result.states.size(), 1U) << result.message;
  EXPECT_EQ(result.states[0].undetermined,
            (std::vector<std::string>{"w_drive", "w_load", "throttle"}))
      << result.message;
  EXPECT_LE(result.states[0].residual, 1e-10);
}

TEST(Trim, TellsADoubleRootFromAFamily) {
  // w^2 (w - 5) = 0
  const TrimResult result = trim(test::sceneFromText("a 0.8", {"both on a: w1^2*(5 - w1)"}), {});
  ASSERT_EQ(result.states.size(), 2U) << result.message;
  EXPECT_NEAR(result.states[0].point.velocity[0], 0.0, 1e-5);
  EXPECT_NEAR(result.states[1].point.velocity[0], 5.0, 1e-10);
}

TEST(Trim, FindsAnElasticTwist) {
  TrimOptions options;
  options.fix = {{"rack", 0.5}};
  Scene scene = test::sceneFromFile(kScenes + "applications/ship_power_unit.yaml");
  // Without the waves
  scene.torques.erase(scene.torques.begin() + 3);
  const TrimResult result = trim(scene, options);
  ASSERT_GE(result.states.size(), 1U) << result.message;
  EXPECT_TRUE(result.states[0].undetermined.empty());
  EXPECT_NEAR(result.states[0].point.velocity[0], result.states[0].point.velocity[1], 1e-9);
  expectSteady(scene, result.states[0], 1e-6);
}

TEST(Trim, FindsAccelerationsInConstantRatio) {
  for (const char* const principle : {"generalized_gauss", "gauss"}) {
    const Scene scene = test::sceneFromText(
        "drive 0.8, load 2",
        {"motor on drive: push", "brake on load: -4", "variator: e_load - 0.5*e_drive"},
        std::string("inputs: [push]\npush: {topic: push, initial: 20}\nprinciple: ") + principle);
    TrimOptions options;
    options.accelerating = true;
    options.fix = {{"w_drive", 10.0}, {"w_load", 3.0}, {"e_drive", 5.0}};
    options.free = {{"push"}};
    const TrimResult result = trim(scene, options);
    ASSERT_EQ(result.states.size(), 1U) << result.message;
    const OperatingPoint& point = result.states[0].point;
    EXPECT_NEAR(point.acceleration[1], 2.5, 1e-10);
    // 0.8 5 - push = -0.5 lambda, 2 2.5 + 4 = lambda
    EXPECT_NEAR(point.input[0], 4.0 + 0.5 * 9.0, 1e-10);
    expectSteady(scene, result.states[0]);
  }
}

TEST(Trim, RefusesNamesByTheNearest) {
  const auto message = [](TrimOptions options) -> std::string {
    return test::messageOf([&] { trim(slipping(""), options); });
  };
  TrimOptions fixed;
  fixed.fix = {{"w_drvie", 1.0}};
  EXPECT_NE(message(fixed).find("did you mean 'w_drive'"), std::string::npos) << message(fixed);
  TrimOptions free;
  free.free = {{"throtle"}};
  EXPECT_NE(message(free).find("did you mean 'throttle'"), std::string::npos) << message(free);
  TrimOptions both;
  both.fix = {{"drive/velocity", 1.0}};
  both.free = {{"w_drive"}};
  EXPECT_NE(message(both).find("both fixed and free"), std::string::npos) << message(both);
  TrimOptions still;
  still.fix = {{"e_drive", 1.0}};
  EXPECT_NE(message(still).find("--accelerating"), std::string::npos) << message(still);
}

TEST(OperatingPoint, IsCompletedFromTheScene) {
  const Scene scene = slipping("");
  const OperatingPoint point = readOperatingPoint(
      readYamlText("{time: 2, velocity: [30, 18], inputs: {throttle: 0.5}}", "s"), scene, "s");
  EXPECT_EQ(point.time, 2.0);
  EXPECT_EQ(point.velocity, (std::vector<double>{30.0, 18.0}));
  EXPECT_EQ(point.angle, (std::vector<double>{0.0, 0.0}));
  EXPECT_EQ(point.input, (std::vector<double>{0.5, 0.0}));
  // The least reaction has psi = 0
  EXPECT_NEAR(point.acceleration[1], 0.6 * point.acceleration[0], 1e-9);
  EXPECT_NO_THROW(linearize(scene, point));
  EXPECT_THROW(readOperatingPoint(readYamlText("{velocity: [1]}", "s"), scene, "s"), SceneError);
  EXPECT_THROW(readOperatingPoint(readYamlText("{speed: [1, 2]}", "s"), scene, "s"), SceneError);
  EXPECT_THROW(readOperatingPoint(readYamlText("{inputs: {gas: 1}}", "s"), scene, "s"), SceneError);
}

Scene lossyGear(const std::string& motor, const std::string& gear, const std::string& rest) {
  return test::sceneFromText(
      "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\ntorques: [m, l]\nm: {type: "
      "variator_sim/ExpressionTorque, shaft: a, torque: \"" +
      motor +
      "\"}\nl: {type: variator_sim/ExpressionTorque, shaft: b, torque: \"-0.4*w_b\"}\n"
      "constraints: [g]\ng: {type: variator_sim/KinematicRatio, shafts: [a, b], ratio: 0.5, " +
      gear + "}\n" + rest);
}

/// The torque that goes through a gear is 1/e_1 or e_2 of what arrives.
TEST(Trim, OfALossyGearIsWithItsLosses) {
  for (const std::string principle : {"principle: gauss\n", "principle: generalized_gauss\n"}) {
    const std::string forward = principle + "initial: {velocity: [2, 1]}\n";
    TrimResult result =
        trim(lossyGear("5 - 0.1*w_a", "efficiency: 0.9, bearing: 0.3", forward), TrimOptions());
    ASSERT_EQ(result.states.size(), 1U) << result.message;
    const OperatingPoint& point = result.states[0].point;
    // 5 - 0.1 w = (0.4 w/2 / 2 + 0.3) / 0.9
    EXPECT_NEAR(point.velocity[0], (5.0 - 0.3 / 0.9) / (0.1 + 0.1 / 0.9), 1e-8);
    EXPECT_EQ(point.mode, std::vector<int>{1});
    Scene scene = lossyGear("5 - 0.1*w_a", "efficiency: 0.9, bearing: 0.3", forward);
    scene.initial = {point.angle, point.velocity, {}, false};
    Simulation simulation(scene);
    ASSERT_TRUE(simulation.advanceTo(1.0).ok());
    EXPECT_NEAR(simulation.sample().velocity[0], point.velocity[0], 1e-7);

    // At rest the bearing holds 0.2 N m.
    result = trim(lossyGear("0.2", "bearing: 0.3", principle), TrimOptions());
    ASSERT_EQ(result.states.size(), 1U) << result.message;
    EXPECT_NEAR(result.states[0].point.velocity[0], 0.0, 1e-12);

    // At the start the load drives, and of steady states only the motor does.
    result = trim(lossyGear("-5 - 0.1*w_a", "efficiency: 0.9", forward), TrimOptions());
    EXPECT_TRUE(result.states.empty());
    EXPECT_NE(result.message.find("'g' would not stay backward"), std::string::npos)
        << result.message;
    EXPECT_EQ(result.message.find("N m"), std::string::npos) << result.message;
  }
}

}  // namespace
}  // namespace variator_sim
