// States that are saved and restored: the motion goes on to the bit.
#include "variator_sim/motion_state.h"

#include "support/scenes.h"
#include "variator_sim/io/yaml_tree.h"

namespace variator_sim {
namespace {

struct Command {
  double time;
  int input;
  double value;
};

struct Case {
  const char* name;
  std::string scene;
  std::vector<double> save_at;
  double end;
  std::vector<Command> commands;
};

std::string fileOf(const std::string& name) {
  return std::string(VARIATOR_SIM_TEST_DIR) + "/../" + name;
}

bool areSame(const Sample& a, const Sample& b, int shafts) {
  const auto same = [&](const double* x, const double* y) {
    return std::memcmp(x, y, sizeof(double) * static_cast<std::size_t>(shafts)) == 0;
  };
  return a.time == b.time && same(a.angle, b.angle) && same(a.velocity, b.velocity) &&
         same(a.acceleration, b.acceleration) && same(a.applied_torque, b.applied_torque) &&
         same(a.reaction_torque, b.reaction_torque);
}

std::vector<Command> later(std::vector<Command> commands, double time) {
  commands.erase(std::remove_if(commands.begin(), commands.end(),
                                [time](const Command& it) { return it.time <= time; }),
                 commands.end());
  return commands;
}

/// Moves on to `end` under the commands from its present on; all samples on the way.
std::vector<Sample> run(Simulation& simulation, const std::vector<Command>& commands, double end) {
  std::vector<Sample> samples;
  const double begin = simulation.time();
  constexpr int kSamples = 37;
  std::size_t next = 0;
  while (next < commands.size() && commands[next].time < begin) ++next;
  for (int n = 1; n <= kSamples; ++n) {
    const double time = begin + (end - begin) * n / kSamples;
    for (; next < commands.size() && commands[next].time <= time; ++next) {
      simulation.advanceTo(commands[next].time);
      simulation.command(commands[next].input, commands[next].value);
    }
    simulation.advanceTo(time);
    samples.push_back(simulation.sample());
  }
  return samples;
}

/// The same scene, started elsewhere.
Scene strangerOf(Scene scene) {
  for (double& velocity : scene.initial.velocity) velocity = 0.9 * velocity + 0.3;
  for (double& acceleration : scene.initial.acceleration) acceleration *= 1.1;
  scene.initial.project = true;
  return scene;
}

ParameterTree throughText(const ParameterTree& tree) {
  return readYamlText(toYaml(tree), "state");
}

/// A pulse that only stages get over, and an event, which is looked for before the next step.
constexpr const char* kPulse = R"yaml(
shafts: [s1]
s1: {inertia: "2.09 + 0.019*sin(phi_s1) - 0.15*cos(t)"}
torques: [pulse, push]
pulse: {type: variator_sim/ExpressionTorque, shaft: s1,
  torque: "2.48*tanh(exp(-((t - 1.94)/0.01)^2)*tanh(cos(t + phi_s1))) - 0.2*w_s1"}
push: {type: variator_sim/ExpressionTorque, shaft: s1, torque: "1.0"}
variables: [turns]
turns: {initial: 0}
events: [turn]
turn: {when: "sin(t)", direction: rising, set: {turns: "turns + 1"}}
)yaml";

class SavedStates : public testing::TestWithParam<Case> {
 protected:
  Scene scene() const {
    const std::string& text = GetParam().scene;
    return text.find('\n') == std::string::npos ? test::sceneFromFile(fileOf(text))
                                                : test::sceneFromText(text);
  }
};

TEST_P(SavedStates, GoOnToTheBit) {
  const Case& parameters = GetParam();
  for (const double save_at : parameters.save_at) {
    SCOPED_TRACE(save_at);
    const std::vector<Command> after = later(parameters.commands, save_at);
    Simulation saved(scene());
    if (save_at > 0.0) run(saved, parameters.commands, save_at);
    MotionState state;
    ASSERT_TRUE(saved.saveState(&state)) << saved.describeStatus();
    const Scene same = scene();
    // The history of another motion is dropped.
    Simulation restored(strangerOf(scene()));
    restored.advanceTo(0.3 * parameters.end);
    const MotionState read = readMotionState(throughText(toTree(state, same)), same, MotionState());
    ASSERT_EQ(restored.setState(read), "");
    EXPECT_EQ(restored.time(), saved.time());
    EXPECT_TRUE(areSame(restored.sample(), saved.sample(), same.shaftCount()));
    const std::vector<Sample> a = run(saved, after, parameters.end);
    const std::vector<Sample> b = run(restored, after, parameters.end);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t n = 0; n < a.size(); ++n) {
      ASSERT_TRUE(areSame(a[n], b[n], same.shaftCount())) << "at " << a[n].time;
    }
    EXPECT_EQ(saved.energy().applied, restored.energy().applied);
    EXPECT_EQ(saved.energy().reactions, restored.energy().reactions);
    EXPECT_EQ(saved.status().reason, restored.status().reason);
  }
}

/// A scene that has its initial values projected (`initial/project`) moves no saved state.
TEST_P(SavedStates, AreNotProjectedWhereTheyAreConsistent) {
  const Case& parameters = GetParam();
  const double save_at = parameters.save_at.front();
  Simulation saved(scene());
  if (save_at > 0.0) run(saved, parameters.commands, save_at);
  MotionState state;
  ASSERT_TRUE(saved.saveState(&state)) << saved.describeStatus();
  Simulation restored(strangerOf(scene()));
  ASSERT_EQ(restored.setState(state, true), "");
  const double end = save_at + 0.1 * (parameters.end - save_at);
  const std::vector<Sample> a = run(saved, {}, end);
  const std::vector<Sample> b = run(restored, {}, end);
  EXPECT_TRUE(areSame(a.front(), b.front(), saved.scene().shaftCount()));
  EXPECT_TRUE(areSame(a.back(), b.back(), saved.scene().shaftCount()));
}

/// Saving costs no more than the tolerance.
TEST_P(SavedStates, DisturbTheMotionWithinTheTolerance) {
  const Case& parameters = GetParam();
  for (const double save_at : parameters.save_at) {
    SCOPED_TRACE(save_at);
    const std::vector<Command> after = later(parameters.commands, save_at);
    Simulation plain(scene());
    Simulation saved(scene());
    for (Simulation* simulation : {&plain, &saved}) {
      if (save_at > 0.0) run(*simulation, parameters.commands, save_at);
    }
    MotionState state;
    ASSERT_TRUE(saved.saveState(&state));
    const Sample a = run(plain, after, parameters.end).back();
    const Sample b = run(saved, after, parameters.end).back();
    for (int i = 0; i < plain.scene().shaftCount(); ++i) {
      EXPECT_NEAR(a.velocity[i], b.velocity[i], 2e-6 * (1.0 + std::abs(a.velocity[i])));
    }
    EXPECT_EQ(plain.statistics().command_timeouts, saved.statistics().command_timeouts);
  }
}

TEST_P(SavedStates, AResetMotionIsTheFirstOneToTheBit) {
  const Case& parameters = GetParam();
  Simulation simulation(scene());
  const std::vector<Sample> first = run(simulation, parameters.commands, parameters.end);
  simulation.reset();
  const std::vector<Sample> second = run(simulation, parameters.commands, parameters.end);
  for (std::size_t n = 0; n < first.size(); ++n) {
    ASSERT_TRUE(areSame(first[n], second[n], simulation.scene().shaftCount()))
        << "at " << first[n].time;
  }
}

const std::string kInputs = test::sceneText(
    "drive 0.5, load 1.2",
    {"jump on drive from jump, hold: zero_order, timeout: 0.31, on_timeout: zero",
     "lag on load from lag, hold: first_order_lag, time_constant: 0.3",
     "ramp on load from ramp, hold: rate_limit, rate: 2",
     "hold on drive from a/hold, hold: first_order_hold, period: 0.7", "drag on load: -0.3*w2",
     "variator: 0.5*(e2-0.8*e1)+0.01*(e1^2+e1*e2)+w2-0.8*w1"},
    "initial: {velocity: [10, 8]}");
const std::vector<Command> kInputCommands{{0.0, 0, 3.0},  {0.4, 1, 2.0},  {0.5, 2, -1.5},
                                          {0.55, 3, 4.0}, {0.9, 0, -2.0}, {1.3, 1, 1.0}};

const std::string kOrder1 =
    test::sceneText("a 1, b 2, c 0.7",
                    {"push on a: 5*sin(t) - 0.1*w_a",
                     "brake = Friction, shaft: b, coulomb: 0.8, regularization_speed: 0.01",
                     "spring = ElasticCoupling, shafts: [b, c], stiffness: 40, damping: 0.05",
                     "belt = KinematicRatio, shafts: [a, b], ratio: {topic: ratio, hold: "
                     "second_order_lag, time_constant: 0.2, initial: 0.8}"},
                    "initial: {velocity: [1, 0.8, 0]}");
const std::vector<Command> kOrder1Commands{{0.7, 0, 1.1}};

const std::string kGaussBranches = test::sceneText(
    "a 1, b 2",
    {"push on a: 1.0 + 0.3*sin(t)", "drag on b: 0.2 - abs(w2)*0.01", "circle: e1^2 + e2^2 - 4"},
    "principle: gauss");

const std::string kFreeShaft =
    test::sceneText("a 1, b 2, free 3",
                    {"push on a: 1 + sin(3*t) - 0.1*w1", "pull on free: cos(2*t) - 0.2*w3",
                     "slip: 0.3*(e2-(0.6+0.1*sin(t))*e1)+w2-(0.6+0.1*sin(t))*w1"},
                    "initial: {acceleration: [1, 0.6, 2]}");

const std::string kResting = test::sceneText(
    "drive 1", {"motor on drive from torque", "drag on drive: -5*w1"}, "initial: {velocity: [3]}");

const std::string kReadsTime = test::sceneText(
    "a 1.3, b 2", {"q on a: 1-0.2*w1", "k: 0.4*(e2-0.6*e1)+w2-0.6*w1+0.2*sin(1.9*t)"},
    "initial: {velocity: [3, 4], acceleration: [0.5, 0.8], project: true}");

/// Saved at the instant at which its torque jumps.
const std::string kJump = test::sceneText("a 1", {"q on a: 2 + sign(t-0.5) + sin(3*t)"});

std::string withSolver(const std::string& scene, const char* solver) {
  return std::string(scene) + "solver: {" + solver + "}\n";
}

const std::string kGeared =
    test::sceneText("a 1, b 2", {"push on a: 3 - 0.1*w1", "gear: e_b - u*e_a"},
                    "inputs: [u]\nu: {topic: u, hold: zero_order, initial: 0.5}\n");

const std::string kGear = test::sceneText(
    "a 1, b 2", {"push on a: 3 - 0.1*w1", "belt = KinematicRatio, shafts: [a, b], ratio: 0.5"},
    "initial: {velocity: [2, 1]}");

MotionState present(Simulation& simulation) {
  MotionState state;
  EXPECT_TRUE(simulation.saveState(&state));
  return state;
}

/// A state without the motion's history.
MotionState written(const std::string& yaml, const Simulation& simulation,
                    const MotionState& otherwise) {
  return readMotionState(readYamlText(yaml, "state"), simulation.scene(), otherwise);
}

// A command at the start is an initial value, which nothing moves along psi = 0; elsewhere one of
// the same instant is a jump.
TEST(StatesOfTheStart, TakeCommandsAsTheStartDoes) {
  const Scene scene = test::sceneFromText(kGeared);
  const auto begin = [&](Simulation& simulation) {
    simulation.command(0, 0.8);
    EXPECT_TRUE(simulation.advanceTo(0.5).ok()) << simulation.describeStatus();
    return simulation.sample();
  };
  Simulation fresh(scene);
  Simulation saved(scene);
  const MotionState state = present(saved);
  Simulation restored(scene);
  restored.advanceTo(0.2);
  ASSERT_EQ(restored.setState(readMotionState(throughText(toTree(state, scene)), scene, {})), "");
  const Sample expected = begin(fresh);
  EXPECT_TRUE(areSame(begin(saved), expected, scene.shaftCount()));
  EXPECT_TRUE(areSame(begin(restored), expected, scene.shaftCount()));
  Simulation stranger(strangerOf(scene));
  ASSERT_EQ(stranger.setState(state), "");
  EXPECT_FALSE(areSame(begin(stranger), expected, scene.shaftCount()));
}

TEST(WrittenStates, InconsistentVelocitiesAreRefusedOrProjected) {
  for (const char* principle : {"", "principle: gauss\n"}) {
    SCOPED_TRACE(principle);
    Simulation simulation(test::sceneFromText(std::string(kGear) + principle));
    simulation.advanceTo(1.0);
    const MotionState before = present(simulation);
    const MotionState wanted = written("shafts: {a: {velocity: 4}}", simulation, before);
    const std::string fault = simulation.setState(wanted);
    EXPECT_NE(fault.find("the velocities [4, "), std::string::npos) << fault;
    EXPECT_NE(fault.find("consistent velocities near them are ["), std::string::npos) << fault;
    // Nothing has changed.
    const MotionState after = present(simulation);
    EXPECT_EQ(toYaml(toTree(after, simulation.scene())),
              toYaml(toTree(before, simulation.scene())));
    EXPECT_EQ(simulation.setState(wanted, true), "");
    const Sample& sample = simulation.sample();
    EXPECT_NEAR(sample.velocity[1], 0.5 * sample.velocity[0], 1e-12);
    // Nearest in the metric of the inertias: the part of (4, w_b) along (1, 0.5).
    const double w_b = before.velocity[1];
    EXPECT_NEAR(sample.velocity[0], (4.0 + 2.0 * 0.5 * w_b) / 1.5, 1e-9);
    EXPECT_EQ(simulation.time(), 1.0);
    EXPECT_TRUE(simulation.advanceTo(2.0).ok());
  }
}

TEST(WrittenStates, UnderGaussAccelerationsOnlySayWhatFollows) {
  Simulation simulation(test::sceneFromText(std::string(kGear) + "principle: gauss\n"));
  const MotionState start = present(simulation);
  EXPECT_NE(simulation.setState(written("shafts: {a: {acceleration: 7}}", simulation, start)), "");
  EXPECT_EQ(simulation.setState(written("shafts: {a: {angle: 7}}", simulation, start)), "");
  EXPECT_NEAR(simulation.sample().acceleration[0], (3.0 - 0.1 * 2.0) / 1.5, 1e-9);
}

TEST(WrittenStates, AccelerationsThatAreNotGivenHaveTheLeastReaction) {
  Simulation simulation(test::sceneFromText(kResting));
  simulation.advanceTo(0.3);
  const MotionState state =
      written("inputs: {torque: {value: 10}}", simulation, present(simulation));
  EXPECT_EQ(simulation.setState(state), "");
  EXPECT_NEAR(simulation.sample().acceleration[0], 10.0 - 5.0 * state.velocity[0], 1e-12);
  EXPECT_EQ(simulation.sample().applied_torque[0], 10.0 - 5.0 * state.velocity[0]);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, SavedStates,
    testing::Values(
        Case{"ship", "config/ship.yaml", {0.0, 0.5, 1.2345}, 3.0, {{0.2, 0, 5.0}, {2.0, 0, 1.0}}},
        Case{"ratio_steps", "config/ratio_steps.yaml", {0.7, 2.0}, 4.0, {{0.5, 0, 20.0}}},
        Case{"circle", "config/acceleration_circle.yaml", {0.4, 1.5}, 2.0, {}},
        Case{
            "car", "config/applications/car.yaml", {0.5, 3.3}, 6.0, {{1.0, 0, 0.5}, {1.0, 1, 0.8}}},
        Case{"starting", "config/applications/starting_system.yaml", {2.0, 4.5}, 8.0, {}},
        Case{"locomotive", "config/applications/diesel_locomotive.yaml", {1.0, 4.0}, 8.0, {}},
        Case{"power_unit", "config/applications/ship_power_unit.yaml", {1.0}, 4.0, {}},
        Case{"vbelt", "config/applications/vbelt_vehicle.yaml", {1.0, 2.7}, 4.0, {}},
        Case{"machine_tool", "config/applications/machine_tool.yaml", {1.0, 2.7}, 4.0, {}},
        Case{"inputs", kInputs, {0.0, 0.45, 0.6, 1.0, 1.21, 1.6}, 3.0, kInputCommands},
        Case{"order1", kOrder1, {0.5, 0.9, 2.0}, 4.0, kOrder1Commands},
        Case{"gauss_branches", kGaussBranches, {0.5, 1.7}, 3.0, {}},
        Case{"reads_time", kReadsTime, {0.37}, 2.018, {}}, Case{"jump", kJump, {0.5}, 1.0, {}},
        Case{"gauss_jump", std::string("principle: gauss\n") + kJump, {0.5}, 1.0, {}},
        Case{"free_shaft", kFreeShaft, {1.0, 2.5}, 6.0, {}},
        Case{"resting", kResting, {1.0, 50.0}, 200.0, {{100.0, 0, 2.0}}},
        Case{"dopri5", withSolver(kInputs, "stepper: dopri5"), {0.6}, 3.0, kInputCommands},
        Case{"fehlberg78", withSolver(kInputs, "stepper: fehlberg78"), {0.6}, 3.0, kInputCommands},
        Case{"radau", withSolver(kInputs, "stepper: radau"), {0.6}, 3.0, kInputCommands},
        Case{"taylor_fixed",
             withSolver(kInputs, "stepper: taylor_fixed, step: 0.003"),
             {0.6},
             3.0,
             kInputCommands},
        Case{"rk4", withSolver(kInputs, "stepper: rk4, step: 0.003"), {0.6}, 3.0, kInputCommands},
        Case{"pulse_and_event", kPulse, {4.251}, 10.0, {}},
        Case{"stiff", "benchmark/scenes/stiff_slip.yaml", {0.3, 0.9}, 2.0, {}}),
    [](const testing::TestParamInfo<Case>& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace variator_sim
