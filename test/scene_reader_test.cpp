// Scenes: what is read, what is filled in, and that every fault is refused by its full path, with
// what is allowed and the nearest valid name.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "support/faults.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/laws.h"
#include "variator_sim/node_names.h"
#include "variator_sim/scene.h"

namespace variator_sim {
namespace {

class FakeConstraint : public Constraint {
  void build(LawContext& scene) override {
    const std::vector<Shaft> shafts = scene.shafts("shafts", 2);
    const double ratio = scene.number("ratio", Range::any(), 1.0);
    scene.constrain(shafts[0].acceleration - ratio * shafts[1].acceleration);
  }
};

class ThrowingTorque : public Torque {
  void build(LawContext& /*scene*/) override { throw std::runtime_error("no licence found"); }
};

class FakeFactory : public ComponentFactory {
 public:
  ConstraintPtr createConstraint(const std::string& type) override {
    if (type == "fake/Gear") return std::make_shared<FakeConstraint>();
    return nullptr;
  }
  TorquePtr createTorque(const std::string& type) override {
    if (type == "fake/Command") return std::make_shared<CommandedTorque>();
    if (type == "fake/Throwing") return std::make_shared<ThrowingTorque>();
    if (type == "fake/Broken") throw std::runtime_error("libbroken.so: undefined symbol");
    return nullptr;
  }
  std::vector<std::string> constraintTypes() override { return {"fake/Gear"}; }
  std::vector<std::string> torqueTypes() override {
    return {"fake/Broken", "fake/Command", "fake/Throwing"};
  }
};

Scene read(const std::string& yaml) {
  FakeFactory factory;
  return readScene(readYamlText(yaml, "scene.yaml"), factory, nodeNames());
}

// Two shafts, a torque and a constraint; cases replace or add lines.
const char* const kShafts = "shafts: [drive, load]\ndrive: {inertia: 0.8}\nload: {inertia: 2}\n";
const char* const kMotor =
    "torques: [motor]\nmotor: {type: fake/Command, shaft: drive, topic: drive_torque}\n";
const char* const kGear =
    "constraints: [gear]\ngear: {type: fake/Gear, shafts: [drive, load], ratio: 2}\n";

std::string base() {
  return std::string(kShafts) + kMotor + kGear;
}
std::string withMotor(const std::string& keys) {
  return std::string(kShafts) + "torques: [motor]\nmotor: {type: fake/Command, " + keys + "}\n";
}

TEST(SceneReader, ReadsAWholeScene) {
  const Scene scene = read(base() + R"(
inertia_coupling: [[load, drive, "5e-2"]]
principle: generalized_gauss
initial: {angle: [1, "2"], velocity: [5, 2.5], acceleration: [2.0, 1.0], project: true}
solver: {stepper: rk4, relative_tolerance: 1e-6, absolute_tolerance: 0, step: 0.01,
         maximum_step: 0.5, maximum_steps: 1000}
)");
  EXPECT_EQ(scene.shafts, (std::vector<std::string>{"drive", "load"}));
  EXPECT_EQ(scene.shaftCount(), 2);
  EXPECT_EQ(scene.inertia(0, 0), 0.8);
  EXPECT_EQ(scene.inertia(1, 1), 2.0);
  EXPECT_EQ(scene.inertia(0, 1), 0.05);
  EXPECT_EQ(scene.inertia(1, 0), 0.05);
  ASSERT_EQ(scene.torques.size(), 1U);
  EXPECT_EQ(scene.torques[0]->name(), "motor");
  ASSERT_EQ(scene.constraintCount(), 1);
  EXPECT_EQ(scene.constraints[0]->name(), "gear");
  EXPECT_EQ(scene.constraints[0]->shaftCount(), 2);
  ASSERT_EQ(scene.inputCount(), 1);
  EXPECT_EQ(scene.inputs[0].topic, "drive_torque");
  EXPECT_EQ(scene.inputs[0].owner, "motor");
  EXPECT_EQ(scene.initial.angle, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(scene.initial.velocity, (std::vector<double>{5.0, 2.5}));
  EXPECT_EQ(scene.initial.acceleration, (std::vector<double>{2.0, 1.0}));
  EXPECT_TRUE(scene.initial.project);
  EXPECT_EQ(scene.solver.stepper, StepperKind::kRk4);
  EXPECT_EQ(scene.solver.relative_tolerance, 1e-6);
  EXPECT_EQ(scene.solver.absolute_tolerance, 0.0);
  EXPECT_EQ(scene.solver.step, 0.01);
  EXPECT_EQ(scene.solver.maximum_step, 0.5);
  EXPECT_EQ(scene.solver.maximum_steps, 1000);
}

TEST(SceneReader, FillsInDefaults) {
  const Scene scene = read("shafts: [wheel]\nwheel: {inertia: 1}\ntick_rate: 500\nsolver:\n");
  EXPECT_TRUE(scene.torques.empty());
  EXPECT_TRUE(scene.constraints.empty());
  EXPECT_TRUE(scene.inputs.empty());
  EXPECT_EQ(scene.initial.angle, std::vector<double>{0.0});
  EXPECT_EQ(scene.initial.velocity, std::vector<double>{0.0});
  EXPECT_TRUE(scene.initial.acceleration.empty());
  EXPECT_FALSE(scene.initial.project);
  EXPECT_EQ(scene.principle, Principle::kGeneralizedGauss);
  EXPECT_EQ(scene.solver.stepper, StepperKind::kAuto);
  EXPECT_EQ(scene.solver.relative_tolerance, 1e-9);
  EXPECT_EQ(scene.solver.absolute_tolerance, 1e-9);
  EXPECT_EQ(scene.solver.step, 0.001);
}

TEST(SceneReader, ResolvedSceneNamesEveryDefaultAndReadsTheSame) {
  const std::string node_keys =
      "tick_rate: 500\npublish_rate: 50\nreal_time_factor: 2\npublish_clock: true\n"
      "start_paused: true\nrealtime_priority: 3\nlock_memory: true\n"
      "estimate_error: true\nverify_derivatives: true\n";
  const Scene scene = read(base() + node_keys);
  const ParameterTree::Dictionary& root = scene.resolved.asDictionary();
  for (const std::string& key : nodeNames().keys) EXPECT_EQ(root.count(key), 0U) << key;
  EXPECT_EQ(root.at("principle").asText(), "generalized_gauss");
  const ParameterTree::Dictionary& solver = root.at("solver").asDictionary();
  EXPECT_EQ(solver.size(), 8U);
  EXPECT_TRUE(solver.at("sleep").asBoolean());
  EXPECT_EQ(solver.at("stepper").asText(), "auto");
  EXPECT_EQ(solver.at("relative_tolerance").asReal(), 1e-9);
  EXPECT_EQ(solver.at("maximum_steps").asInteger(), 1000000);
  EXPECT_EQ(root.at("initial").toText(),
            "{angle: [0.0, 0.0], project: false, velocity: [0.0, 0.0]}");
  EXPECT_EQ(root.at("drive").toText(), "{inertia: 0.8}");
  EXPECT_EQ(root.at("inertia_coupling").toText(), "[]");
  EXPECT_EQ(root.at("motor").asDictionary().at("topic").asText(), "drive_torque");

  FakeFactory factory;
  const Scene again = readScene(scene.resolved, factory);
  EXPECT_EQ(again.shafts, scene.shafts);
  EXPECT_EQ(again.inertia, scene.inertia);
  EXPECT_EQ(again.inputs[0].topic, scene.inputs[0].topic);
}

// The core alone knows no node.
TEST(SceneReader, KeepsNoNamesButItsOwn) {
  FakeFactory factory;
  const auto read_alone = [&factory](const std::string& yaml) {
    return readScene(readYamlText(yaml, "scene.yaml"), factory, NodeNames{});
  };
  EXPECT_EQ(read_alone(withMotor("shaft: drive, topic: state")).inputs[0].topic, "state");
  EXPECT_THROW(read_alone(base() + "tick_rate: 500\n"), SceneError);
}

TEST(SceneReader, NamesPrinciplesAndSteppersAsTheSceneDoes) {
  EXPECT_STREQ(toString(Principle::kGeneralizedGauss), "generalized_gauss");
  for (const char* name :
       {"auto", "rk4", "dopri5", "fehlberg78", "radau", "taylor", "taylor_fixed"}) {
    const Scene scene = read(base() + "solver: {stepper: " + name + "}\n");
    EXPECT_STREQ(toString(scene.solver.stepper), name);
    EXPECT_EQ(scene.resolved.asDictionary().at("solver").asDictionary().at("stepper").asText(),
              name);
  }
}

TEST(SceneReader, KnowsWhichSteppersHaveFixedSteps) {
  for (StepperKind kind : {StepperKind::kRk4, StepperKind::kTaylorFixed}) {
    EXPECT_TRUE(isFixedStep(kind)) << toString(kind);
  }
  for (StepperKind kind : {StepperKind::kAuto, StepperKind::kDopri5, StepperKind::kFehlberg78,
                           StepperKind::kRadau, StepperKind::kTaylor}) {
    EXPECT_FALSE(isFixedStep(kind)) << toString(kind);
  }
}

TEST(SceneReader, ReadsWhetherAMotionMaySleep) {
  EXPECT_TRUE(read(base()).solver.sleep);
  EXPECT_TRUE(read(base() + "solver: {sleep: true}\n").solver.sleep);
  const Scene scene = read(base() + "solver: {sleep: false}\n");
  EXPECT_FALSE(scene.solver.sleep);
  const ParameterTree::Dictionary& solver =
      scene.resolved.asDictionary().at("solver").asDictionary();
  EXPECT_FALSE(solver.at("sleep").asBoolean());
  FakeFactory factory;
  EXPECT_FALSE(readScene(scene.resolved, factory).solver.sleep);
}

TEST(CommandedTorque, AddsGainTimesInputToItsShaft) {
  const Scene scene = read(withMotor("shaft: load, topic: brake, gain: -2"));
  const double input[] = {3.0};
  const double input_rate[] = {0.5};
  const StateView state{0.0, nullptr, nullptr, nullptr, input, input_rate};
  double torque[] = {1.0, 1.0};
  double torque_rate[] = {1.0, 1.0};
  scene.torques[0]->addTorque(state, torque);
  scene.torques[0]->addTorqueRate(state, torque_rate);
  EXPECT_EQ(torque[0], 1.0);
  EXPECT_EQ(torque[1], 1.0 - 6.0);
  EXPECT_EQ(torque_rate[0], 1.0);
  EXPECT_EQ(torque_rate[1], 1.0 - 1.0);
}

const char* const kOnScene = R"(
# root
solvr: {step: 1} => solvr: unknown key | 'solver' | allowed:
principal: gauss => principal: unknown key | 'principle'
tik_rate: 10 => tik_rate: unknown key | 'tick_rate'
moter: {type: fake/Command}
  => moter: 'motor' | in none of the lists shafts, torques, constraints, inputs, tables, outputs
  | as its 'type' belongs in 'torques' or 'constraints'
wheel: {inertia: 2} => wheel: as its 'inertia' belongs in 'shafts'
outputs: [ratio] => ratio: missing
outputs: [drive] => outputs[0]: 'drive' is listed twice | in shafts and in outputs
outputs: [outputs] => outputs[0]: 'outputs' is a key of the scene
outputs: [tick_rate] => outputs[0]: 'tick_rate' is a key of the node
outputs: [1st] => outputs[0]: '1st' is not a valid name
output: [ratio] / ratio: {expression: w1} => output: unknown key | 'outputs'
outputs: [ratio] / ratio: {expression: w1, unit: s}
  => ratio/unit: unknown key | expression, parameters
outputs: [ratio] / ratio: {expresion: w1} => ratio/expression: missing | 'expresion'
outputs: [ratio] / ratio: {expression: w1/v} => ratio/expression: unknown name 'v' | column 4
outputs: [ratio] / ratio: {expression: j1}
  => ratio/expression: 'j1' | jerks occur in constraints of order 3 only
outputs: [ratio] / ratio: {expression: k, parameters: {k: .nan}} => ratio/parameters/k: finite
principle: gaus => principle: 'gaus' | did you mean 'gauss'
principle: generalised_gauss => principle: 'generalised_gauss' | did you mean 'generalized_gauss'
# inertia
inertia_coupling: 5 => inertia_coupling: a list | an integer: 5
inertia_coupling: [drive, load, 0.1] => inertia_coupling[0]: [shaft, shaft, value | drive
inertia_coupling: [[drive, load]] => inertia_coupling[0]: [drive, load]
inertia_coupling: [[1, load, 2]] => inertia_coupling[0]: [1, load, 2]
inertia_coupling: [[drive, laod, 0.1]] => inertia_coupling[0][1]: 'laod' | 'load' | drive, load
inertia_coupling: [[drive, drive, 0.1]] => inertia_coupling[0]: with itself
inertia_coupling: [[drive, load, 0.1], [load, drive, 0.1]] => inertia_coupling[1]: second time
inertia_coupling: [[drive, load, big]] => inertia_coupling[0][2]: a finite number | big
# initial and solver
initial: {angel: [0, 0]} => initial/angel: unknown key | 'angle' | velocity
initial: {angle: [0]} => initial/angle: a list of 2 | got 1
initial: {velocity: [0, 1, 2]} => initial/velocity: list of 2
initial: {acceleration: [0, x]} => initial/acceleration[1]: a finite number | x
initial: {acceleration: [nan, 1]} => initial/acceleration[0]: nan | finite
initial: {acceleration: 3} => initial/acceleration: a list of 2
initial: {project: 1} => initial/project: true or false | 1
initial: [0, 0] => initial: a dictionary | a list: [0, 0]
solver: {steper: rk4}
  => solver/steper: unknown key (did you mean 'stepper'?) | allowed:  | relative_tolerance
solver: {stepper: dopri}
  => solver/stepper: 'dopri' | did you mean 'dopri5'
  | auto, rk4, dopri5, fehlberg78, radau, taylor, taylor_fixed
solver: {stepper: rosenbrock4}
  => solver/stepper: 'rosenbrock4' was removed; use 'radau'; allowed: auto, rk4, dopri5, fehlberg78,
  radau, taylor, taylor_fixed
solver: {stepper: rosenbrock4_fixed} => solver/stepper: 'rosenbrock4_fixed' was removed; use 'radau'
solver: {stepper: radau5} => solver/stepper: 'radau5' was removed; use 'radau'
solver: {stepper: dop853} => solver/stepper: 'dop853' was removed; use 'fehlberg78'
solver: {stepper: radau5_fixed} => solver/stepper: 'radau5_fixed' was removed; use 'radau'
solver: {stepper: dopri5_fixed} => solver/stepper: 'dopri5_fixed' was removed; use 'rk4'
solver: {stepper: [radau5]} => solver/stepper: expected one of auto, rk4, | a list
solver: {stepper: rada} => solver/stepper: 'rada' | did you mean 'radau'
solver: {stepper: rk4_fixed} => solver/stepper: 'rk4_fixed' is not allowed | allowed: auto, rk4,
solver: {sleep: 1} => solver/sleep: true or false | 1
solver: {sleep: sometimes} => solver/sleep: true or false | sometimes
solver: {sleeps: true} => solver/sleeps: unknown key (did you mean 'sleep'?)
solver: {skip_angles: false} => solver/skip_angles: unknown key
solver: {stepper: 4} => solver/stepper: one of auto | 4
solver: {relative_tolerance: 0} => solver/relative_tolerance: 0 | from 1e-14 to 0.1
solver: {relative_tolerance: 0.2} => solver/relative_tolerance: 0.2 | from 1e-14 to 0.1
solver: {absolute_tolerance: -1e-9} => solver/absolute_tolerance: -1e-9 | >= 0
solver: {step: 0} => solver/step: > 0
solver: {step: .inf} => solver/step: .inf | finite
solver: {maximum_step: 0} => solver/maximum_step: > 0
solver: {maximum_steps: 0} => solver/maximum_steps: from 1
solver: {maximum_steps: 1.5} => solver/maximum_steps: 1.5 is not an integer
solver: 3 => solver: a dictionary
)";

const char* const kOnShafts = R"(
# root
torqes: [motor] / motor: {type: fake/Command} => torqes: unknown key | 'torques'
# names
torques: [load] => torques[0]: 'load' is listed twice | in shafts and in torques
torques: [motor] / motor: {type: fake/Command, shaft: drive, topic: drive_torque} / constraints:
  [motor]
  => constraints[0]: 'motor' is listed twice | in torques and in constraints
constraints: [a, b] => constraints: 2 constraints | 2 shafts | at most 1
torques: [motor] => motor: missing
# components
torques: [m] / m: {shaft: drive} => m/type: missing
torques: [m] / m: {tpye: fake/Command} => m/type: missing | 'tpye'
torques: [m] / m: {type: fake/Comand}
  => m/type: 'fake/Comand' | did you mean 'fake/Command' | fake/Broken, fake/Command
torques: [m] / m: {type: Command} => m/type: 'Command' | did you mean 'fake/Command'
torques: [m] / m: {type: fake/Gear}
  => m/type: 'fake/Gear' is a constraint, not a torque | belongs in constraints
constraints: [m] / m: {type: fake/Command}
  => m/type: 'fake/Command' is a torque, not a constraint | belongs in torques
torques: [m] / m: {type: fake/Broken} => m/type: 'fake/Broken' cannot be loaded | undefined symbol
torques: [m] / m: {type: fake/Throwing} => m: fake/Throwing | no licence found
constraints: [g] / g: {type: fake/Gear, shafts: [drive]} => g/shafts: 2 different shafts | [drive]
constraints: [g] / g: {type: fake/Gear} => g/shafts: 2 different shafts | nothing
constraints: [g] / g: {type: fake/Gear, shafts: [load, load]} => g/shafts: 'load' twice
constraints: [g] / g: {type: fake/Gear, shafts: [load, diver]} => g/shafts[1]: 'diver'
torques: [one, two] / one: {type: fake/Command, shaft: drive, topic: same} / two: {type:
  fake/Command, shaft: load, topic: same}
  => two/topic: 'same' is used twice | 'one' | 'two'
)";

const char* const kWhole = R"(
# root
shaft: [drive] / drive: {inertia: 1} => shafts: missing | 'shaft' | 1 to 8
principle: generalized_gauss => shafts: missing | names
# names
shafts: [] => shafts: 0 shafts | 1 to 8
shafts: drive => shafts: a list of names | a text: drive
shafts: [a, b, c, d, e, f, g, h, i] => shafts: 9 shafts | 1 to 8
shafts: [drive, 7] => shafts[1]: a text | an integer: 7
shafts: [drive, 1st] => shafts[1]: '1st' | starting with a letter
shafts: [drive, a-b] => shafts[1]: 'a-b' | letters, digits and '_'
shafts: [''] => shafts[0]: '' | valid name
shafts: [drive, drive] => shafts[1]: 'drive' is listed twice
shafts: [solver] => shafts[0]: 'solver' | key of the scene
shafts: [tick_rate] => shafts[0]: 'tick_rate' | key of the node
shafts: [verify_derivatives] => shafts[0]: key of the scene
shafts: [drive, load] / drive: {inertia: 1} => load: missing | dictionary
shafts: [drive] / dirve: {inertia: 1} => drive: missing | 'dirve'
shafts: [drive] / drive: 0.8 => drive: a dictionary | a number: 0.8
# inertia
shafts: [d] / d: {} => d/inertia: missing | > 0
shafts: [d] / d: => d/inertia: missing
shafts: [d] / d: {inertia: 0} => d/inertia: 0 is out of range | > 0
shafts: [d] / d: {inertia: -1.5} => d/inertia: -1.5 | > 0
shafts: [d] / d: {inertia: .nan} => d/inertia: .nan | finite
shafts: [d] / d: {inertia: 1 kg} => d/inertia: '1 kg' | a text | > 0
shafts: [d] / d: {inertia: true} => d/inertia: a boolean: true
shafts: [d] / d: {inertia: {men: 2.0}} => d/inertia/mean: missing | 'men'
shafts: [d] / d: {inertia: {mean: 2.0, harmonics: [{order: 1, cos: 2.5}]}}
  => d/inertia: -0.5 | > 0 at every angle
shafts: [d] / d: {inertia: {mean: 2.0, harmonics: [{order: 0, cos: 1}]}}
  => d/inertia/harmonics[0]/order: 0 | 1
shafts: [d] / d: {inertia: {mean: 2.0, harmonics: [{order: 1, coss: 1}]}}
  => d/inertia/harmonics[0]/coss: unknown key | 'cos'
shafts: [d] / d: {inertia: {mean: 2.0, harmonics: 3}} => d/inertia/harmonics: a list | 3
# (positive alone at every angle, but not together with the coupling at the least one)
shafts: [a, b] / a: {inertia: {mean: 2.0, harmonics: [{order: 2, sin: 1.5}]}} / b: {inertia: 1} /
  inertia_coupling: [[a, b, 0.8]]
  => inertia_coupling: indefinite | smallest eigenvalue
shafts: [d] / d: {inertia: 1, inetria: 2} => d/inetria: unknown key | 'inertia'
shafts: [a, b] / a: {inertia: 1} / b: {inertia: 1} / inertia_coupling: [[a, b, 3]]
  => inertia_coupling: smallest eigenvalue is -2.0 | positive definite
)";

const char* const kOnMotor = R"(
# components
shaft: drive, topic: a, gian: 2 => motor/gian: unknown key | 'gain' | time_constant
shaft: driv, topic: a => motor/shaft: 'driv' is not a shaft | did you mean 'drive' | drive, load
topic: a => motor/shaft: missing
shaft: drive, topic: a, gain: much => motor/gain: much
# inputs
shaft: drive => motor/topic: missing
shaft: drive, topic: /a => motor/topic: '/a' | private
shaft: drive, topic: ~a => motor/topic: '~a'
shaft: drive, topic: 1a => motor/topic: starting with a letter
shaft: drive, topic: a-b => motor/topic: 'a-b'
shaft: drive, topic: a//b => motor/topic: 'a//b'
shaft: drive, topic: a/ => motor/topic: 'a/'
shaft: drive, topic: '' => motor/topic: ''
shaft: drive, topic: state => motor/topic: of the node itself
shaft: drive, topic: parameter_updates => motor/topic: of the node itself
shaft: drive, topic: a, hold: zero_oder
  => motor/hold: 'zero_oder' | did you mean 'zero_order' | rate_limit
shaft: drive, topic: a, hold: first_order_lag => motor/time_constant: missing | > 0
shaft: drive, topic: a, hold: first_order_lag, tau: 1 => motor/time_constant: missing
shaft: drive, topic: a, hold: first_order_lag, time_constant: 0 => motor/time_constant: > 0
shaft: drive, topic: a, hold: rate_limit => motor/rate: missing
shaft: drive, topic: a, hold: rate_limit, rate: -1 => motor/rate: -1 | > 0
shaft: drive, topic: a, hold: first_order_hold => motor/period: missing
shaft: drive, topic: a, hold: first_order_hold, period: 0 => motor/period: > 0
shaft: drive, topic: a, time_constant: 1
  => motor/time_constant: belongs to hold 'first_order_lag' | 'zero_order'
shaft: drive, topic: a, hold: first_order_lag, rate: 1
  => motor/rate: belongs to hold 'rate_limit' | 'first_order_lag'
shaft: drive, topic: a, hold: rate_limit, rate: 1, period: 1
  => motor/period: belongs to hold 'first_order_hold' | 'rate_limit'
shaft: drive, topic: a, min: 2, max: 1 => motor/max: 1 | >= 2
shaft: drive, topic: a, max: .inf => motor/max: .inf | finite
shaft: drive, topic: a, min: -1, max: 1, initial: 2 => motor/initial: 2 | from -1 to 1
shaft: drive, topic: a, min: 1 => motor/initial: the default | >= 1
shaft: drive, topic: a, timeout: -1 => motor/timeout: >= 0
shaft: drive, topic: a, on_timeout: hlod => motor/on_timeout: 'hlod' | 'hold' | hold, zero
shaft: drive, topic: a, min: 1, initial: 1, on_timeout: zero => motor/on_timeout: 'zero' | >= 1
)";

TEST(SceneReader, RefusesFaultsByPathAndWords) {
  test::expectFaults(test::readFaults(base(), kOnScene), read);
  test::expectFaults(test::readFaults(kShafts, kOnShafts), read);
  test::expectFaults(test::readFaults("", kWhole), read);
  test::expectFaults(test::readFaults("", kOnMotor),
                     [](const std::string& keys) { read(withMotor(keys)); });
}

TEST(SceneReader, RefusesARootThatIsNoDictionary) {
  FakeFactory factory;
  EXPECT_THROW(readScene(ParameterTree(), factory), SceneError);
  EXPECT_THROW(readScene(ParameterTree::list(), factory), SceneError);
}

TEST(SceneReader, ReadsEveryInputSetting) {
  const auto input = [](const std::string& keys) {
    return read(withMotor("shaft: drive, topic: arm/torque_1, " + keys)).inputs.at(0);
  };
  const CommandInputSettings plain = input("gain: 1");
  EXPECT_EQ(plain.topic, "arm/torque_1");
  EXPECT_EQ(plain.hold, Hold::kZeroOrder);
  EXPECT_EQ(plain.initial, 0.0);
  EXPECT_EQ(plain.minimum, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(plain.maximum, std::numeric_limits<double>::infinity());
  EXPECT_EQ(plain.timeout, 0.0);
  EXPECT_EQ(plain.on_timeout, OnTimeout::kHold);
  const CommandInputSettings lag = input(
      "hold: first_order_lag, time_constant: 0.2, initial: 3, min: -5, max: 5, timeout: 1, "
      "on_timeout: zero");
  EXPECT_EQ(lag.hold, Hold::kFirstOrderLag);
  EXPECT_EQ(lag.time_constant, 0.2);
  EXPECT_EQ(lag.initial, 3.0);
  EXPECT_EQ(lag.minimum, -5.0);
  EXPECT_EQ(lag.maximum, 5.0);
  EXPECT_EQ(lag.timeout, 1.0);
  EXPECT_EQ(lag.on_timeout, OnTimeout::kZero);
  const CommandInputSettings ramp = input("hold: rate_limit, rate: 7");
  EXPECT_EQ(ramp.hold, Hold::kRateLimit);
  EXPECT_EQ(ramp.rate, 7.0);
  const CommandInputSettings line = input("hold: first_order_hold, period: 0.1");
  EXPECT_EQ(line.hold, Hold::kFirstOrderHold);
  EXPECT_EQ(line.period, 0.1);
}

TEST(SceneReader, RefusesOneInputTooMany) {
  std::string list;
  std::string dictionaries;
  for (int i = 0; i <= kMaxInputs; ++i) {
    const std::string name = "m" + std::to_string(i);
    list += (i > 0 ? ", " : "") + name;
    dictionaries += name + ": {type: fake/Command, shaft: drive, topic: " + name + "}\n";
  }
  try {
    read(std::string(kShafts) + "torques: [" + list + "]\n" + dictionaries);
    FAIL() << "accepted";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.keyPath(), "m32/topic");
  }
}

TEST(BuiltinComponents, AreMadeByTheirFullNames) {
  BuiltinComponentFactory factory;
  for (const std::string& type : factory.constraintTypes()) {
    EXPECT_NE(factory.createConstraint(type), nullptr) << type;
    EXPECT_EQ(factory.createTorque(type), nullptr) << type;
  }
  for (const std::string& type : factory.torqueTypes()) {
    EXPECT_NE(factory.createTorque(type), nullptr) << type;
    EXPECT_EQ(factory.createConstraint(type), nullptr) << type;
  }
  EXPECT_NE(factory.createTorque("variator_sim/CommandedTorque"), nullptr);
  EXPECT_EQ(factory.createTorque("CommandedTorque"), nullptr);
}

// psi = epsilon_1^2 epsilon_2 + phi_1^3 + t omega_2 + 2 u_1
class CubicConstraint : public Constraint {
  void build(LawContext& scene) override {
    const Shaft a = scene.shaftAt(0);
    const Shaft b = scene.shaftAt(1);
    scene.constrain(a.acceleration * a.acceleration * b.acceleration + a.angle * a.angle * a.angle +
                    scene.time() * b.velocity + 2.0 * scene.command());
  }
};

TEST(ConstraintOfAPlugin, HasTheRowJacobiansAndHessianOfItsFormula) {
  CubicConstraint constraint;
  const ParameterTree tree = readYamlText("topic: u", "test");
  ParameterReader reader(tree, "cubic");
  const std::vector<std::string> shafts{"a", "b"};
  std::vector<CommandInputSettings> inputs(1);
  ComponentContext context("cubic", reader, shafts, inputs);
  constraint.configure(context);

  const double angle[] = {2.0, 0.0};
  const double velocity[] = {3.0, 5.0};
  const double acceleration[] = {7.0, -11.0};
  const double input[] = {0.0, 1.5};
  const double input_rate[] = {1e300, 13.0};
  const StateView state{0.5, angle, velocity, acceleration, input, input_rate, input_rate};

  double C[2] = {-1.0, -1.0};
  EXPECT_EQ(constraint.calcResidualAndJacobian(state, C), 49.0 * -11.0 + 8.0 + 2.5 + 3.0);
  EXPECT_EQ(C[0], -154.0);
  EXPECT_EQ(C[1], 49.0);

  double c0 = 0.0;
  C[0] = C[1] = -1.0;
  constraint.calcRow(state, C, &c0);
  EXPECT_EQ(C[0], -154.0);
  EXPECT_EQ(C[1], 49.0);
  EXPECT_EQ(c0, 5.0 + 12.0 * 3.0 + 0.5 * -11.0 + 2.0 * 13.0);

  ConstraintPartials partials;
  constraint.calcPartials(state, partials);
  EXPECT_EQ(partials.input[0], 0.0);
  EXPECT_EQ(partials.input[1], 2.0);

  double H[4] = {};
  constraint.calcHessian(state, H);
  EXPECT_NEAR(H[0], -22.0, 1e-8);
  EXPECT_NEAR(H[1], 14.0, 1e-8);
  EXPECT_EQ(H[1], H[2]);
  EXPECT_NEAR(H[3], 0.0, 1e-8);
}

TEST(SceneReader, TellsSeveralFaultsTogether) {
  const std::string scene =
      "shafts: [drive, load]\ndrive: {inertia: -1}\nload: {inertia: 2}\n"
      "torques: [motor, brake]\n"
      "motor: {type: fake/Command, shaft: driv, topic: drive_torque}\n"
      "brake: {type: fake/Comand, shaft: load, topic: brake}\n"
      "solver: {stepper: rk5}\n";
  try {
    read(scene);
    FAIL() << "no error";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.keyPath(), "drive/inertia");
    const std::string message = error.what();
    EXPECT_EQ(message.rfind("drive/inertia: -1 is out of range", 0), 0U) << message;
    EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 3) << message;
    for (const char* const line :
         {"\nsolver/stepper: 'rk5' is not allowed", "\nmotor/shaft: 'driv' is not a shaft",
          "\nbrake/type: 'fake/Comand' is not a known type"}) {
      EXPECT_NE(message.find(line), std::string::npos) << message;
    }
  }
}

// Formulas that read an input which cannot be read are not blamed.
TEST(SceneReader, TellsNoFaultThatFollowsFromAnother) {
  const std::string scene = std::string(kShafts) +
                            "inputs: [throttle]\nthrottle: {topic: throttle, hold: none}\n" +
                            "outputs: [twice]\ntwice: {expression: 2*throttle}\n";
  try {
    read(scene);
    FAIL() << "no error";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.keyPath(), "throttle/hold");
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
  }
}

TEST(SceneReader, TellsNoMoreFaultsThanCanBeRead) {
  std::string scene = std::string(kShafts) + "torques: [m0";
  for (int i = 1; i < 1000; ++i) scene += ", m" + std::to_string(i);
  scene += "]\n";
  for (int i = 0; i < 1000; ++i) scene += "m" + std::to_string(i) + ": {type: none}\n";
  try {
    read(scene);
    FAIL() << "no error";
  } catch (const SceneError& error) {
    EXPECT_LE(std::string(error.what()).size(), kLongestMessage);
    EXPECT_NE(std::string(error.what()).find("990 more"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace variator_sim
