// Scenes: what is read, what is filled in, and that every fault is refused by its full path, with
// what is allowed and the nearest valid name.

#include <stdexcept>

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/laws.h"

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

class ThrowingANumber : public Torque {
  void build(LawContext& /*scene*/) override { throw 5; }
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
    if (type == "fake/Number") return std::make_shared<ThrowingANumber>();
    if (type == "fake/Broken") throw std::runtime_error("libbroken.so: undefined symbol");
    return nullptr;
  }
  std::vector<std::string> constraintTypes() override { return {"fake/Gear"}; }
  std::vector<std::string> torqueTypes() override {
    return {"fake/Broken", "fake/Command", "fake/Number", "fake/Throwing"};
  }
};

Scene read(const std::string& yaml) {
  FakeFactory factory;
  return readScene(readYamlText(yaml, "scene.yaml"), factory, nodeNames());
}

// Two shafts, a torque and a constraint; cases replace or add lines.
const std::string kShafts = test::sceneText("drive 0.8, load 2", {});
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
  const Scene scene = read(test::sceneText("wheel 1", {}, "tick_rate: 500\nsolver: ~"));
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

TEST(SceneReader, RefusesFaultsByPathAndWords) {
  const std::map<std::string, std::function<void(const std::string&)>> readers = {
      {"behind a whole scene", [](const std::string& text) { read(base() + text); }},
      {"behind two shafts", [](const std::string& text) { read(kShafts + text); }},
      {"the whole text", [](const std::string& text) { read(text); }},
      {"keys of a commanded torque", [](const std::string& keys) { read(withMotor(keys)); }}};
  const auto sections = test::readFaultSections("scenes");
  EXPECT_EQ(sections.size(), readers.size());
  for (const auto& [head, rows] : sections) {
    test::expectFaults(test::readFaults("", rows), readers.at(head));
  }
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
  EXPECT_EQ(lag.hold_parameter, 0.2);
  EXPECT_EQ(lag.initial, 3.0);
  EXPECT_EQ(lag.minimum, -5.0);
  EXPECT_EQ(lag.maximum, 5.0);
  EXPECT_EQ(lag.timeout, 1.0);
  EXPECT_EQ(lag.on_timeout, OnTimeout::kZero);
  const CommandInputSettings ramp = input("hold: rate_limit, rate: 7");
  EXPECT_EQ(ramp.hold, Hold::kRateLimit);
  EXPECT_EQ(ramp.hold_parameter, 7.0);
  const CommandInputSettings line = input("hold: first_order_hold, period: 0.1");
  EXPECT_EQ(line.hold, Hold::kFirstOrderHold);
  EXPECT_EQ(line.hold_parameter, 0.1);
}

TEST(SceneReader, RefusesOneInputTooMany) {
  std::string list;
  std::string dictionaries;
  for (int i = 0; i <= kMaxInputs; ++i) {
    const std::string name = "m" + std::to_string(i);
    list += (i > 0 ? ", " : "") + name;
    dictionaries += name + ": {type: fake/Command, shaft: drive, topic: " + name + "}\n";
  }
  test::expectRefused("m32/topic", {}, [&] {
    read(std::string(kShafts) + "torques: [" + list + "]\n" + dictionaries);
  });
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
  LawContext context("cubic", reader, shafts, inputs);
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
  test::expectRefused(
      "drive/inertia",
      {"drive/inertia: -1 is out of range", "\nsolver/stepper: 'rk5' is not allowed",
       "\nmotor/shaft: 'driv' is not a shaft", "\nbrake/type: 'fake/Comand' is not a known type"},
      [&] { read(scene); });
  const std::string message = test::messageOf([&] { read(scene); });
  EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 3) << message;
}

// Formulas that read an input which cannot be read are not blamed.
TEST(SceneReader, TellsNoFaultThatFollowsFromAnother) {
  const std::string scene = std::string(kShafts) +
                            "inputs: [throttle]\nthrottle: {topic: throttle, hold: none}\n" +
                            "outputs: [twice]\ntwice: {expression: 2*throttle}\n";
  test::expectRefused("throttle/hold", {}, [&] { read(scene); });
  const std::string message = test::messageOf([&] { read(scene); });
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
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
