// Quantities of a motion beside its state: by name, on request, without effect on the motion.

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

// Elements on one shaft, between two, between a shaft and the ground; all kinds of inputs.
constexpr const char* kScene = R"yaml(
shafts: [drive, load]
drive: {inertia: 0.5}
load: {inertia: {mean: 1.2, harmonics: [{order: 2, cos: 0.1}]}}
torques: [engine, spring, bearing, drag]
engine: {type: variator_sim/CommandedTorque, shaft: drive, topic: engine/torque, hold: first_order_lag, time_constant: 0.2, initial: 4.0, min: -10.0, max: 10.0}
spring: {type: variator_sim/ElasticCoupling, shafts: [load, drive], stiffness: 30.0, damping: 0.5, ratio: 0.6}
bearing: {type: variator_sim/Friction, shaft: load, coulomb: 0.4, viscous: 0.02, regularization_speed: 0.01}
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.02*w2^2 - 0.3*sin(t)"}
constraints: [belt]
belt: {type: variator_sim/SlipRatio, shafts: [drive, load], time_constant: 0.1, ratio: {topic: ratio, hold: rate_limit, rate: 0.5, initial: 0.5, min: 0.1, max: 0.9}}
outputs: [ratio_now, jolt, no_value]
ratio_now: {expression: "k*w2/w1 + 0*phi1", parameters: {k: 2.0}}
jolt: {expression: "e1 - 3*e2 + t"}
no_value: {expression: "sqrt(w1 - 1000)"}
initial: {velocity: [8.0, 4.5]}
principle: )yaml";

Scene makeScene(const std::string& principle = "generalized_gauss") {
  return test::sceneFromText(kScene + principle);
}

/// A group's quantities at the present, by name.
std::map<std::string, double> valuesOf(Simulation& simulation, QuantityGroup group) {
  const std::vector<std::string>& names = simulation.quantityNames(group);
  std::vector<double> values(names.size(), -1.0);
  simulation.calcQuantities(group, values.data());
  std::map<std::string, double> by_name;
  for (std::size_t i = 0; i < names.size(); ++i) by_name[names[i]] = values[i];
  EXPECT_EQ(by_name.size(), names.size()) << "a name twice";
  return by_name;
}

/// The actions common to two runs.
void commandAt(Simulation& simulation, int n) {
  if (n == 40) simulation.command(0, 25.0);  // clamped to 10
  if (n == 70) simulation.command(1, 0.8);
  if (n == 130) simulation.command(0, -3.0);
}

TEST(Quantities, AreNamedInTheOrderOfTheScene) {
  const Simulation simulation(makeScene());
  using Names = std::vector<std::string>;
  EXPECT_EQ(
      simulation.quantityNames(QuantityGroup::kElements),
      (Names{"engine/drive/torque", "engine/power", "spring/drive/torque", "spring/load/torque",
             "spring/power", "spring/twist", "spring/transmitted_torque", "bearing/load/torque",
             "bearing/power", "bearing/slip", "bearing/transmitted_torque", "drag/load/torque",
             "drag/power", "belt/slip", "belt/ratio"}));
  EXPECT_EQ(simulation.quantityNames(QuantityGroup::kInputs), (Names{"engine/torque", "ratio"}));
  EXPECT_EQ(simulation.quantityNames(QuantityGroup::kOutputs),
            (Names{"ratio_now", "jolt", "no_value"}));
}

TEST(Quantities, OfElementsAddUpToTheAppliedTorqueAndItsPower) {
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    Simulation simulation(makeScene(principle));
    for (int n = 0; n <= 200; ++n) {
      simulation.advanceTo(n / 100.0);
      commandAt(simulation, n);
      const Sample sample = simulation.sample();
      const auto values = valuesOf(simulation, QuantityGroup::kElements);
      ASSERT_TRUE(simulation.status().ok());
      const double on_drive = values.at("engine/drive/torque") + values.at("spring/drive/torque");
      const double on_load = values.at("spring/load/torque") + values.at("bearing/load/torque") +
                             values.at("drag/load/torque");
      ASSERT_NEAR(on_drive, sample.applied_torque[0], 1e-13 * 50) << n;
      ASSERT_NEAR(on_load, sample.applied_torque[1], 1e-13 * 50) << n;
      const double power = values.at("engine/power") + values.at("spring/power") +
                           values.at("bearing/power") + values.at("drag/power");
      ASSERT_NEAR(power, simulation.energy().applied_power, 1e-12 * 500) << n;
      ASSERT_EQ(values.at("engine/power"), values.at("engine/drive/torque") * sample.velocity[0]);
      ASSERT_LT(values.at("bearing/power"), 0.0);
    }
  }
}

TEST(Quantities, OfConstraintsAreTheLaws) {
  Simulation simulation(makeScene());
  for (int n = 0; n <= 200; ++n) {
    simulation.advanceTo(n / 100.0);
    commandAt(simulation, n);
    const Sample sample = simulation.sample();
    const auto values = valuesOf(simulation, QuantityGroup::kElements);
    const double i = n <= 70 ? 0.5 : std::min(0.8, 0.5 + 0.5 * (n / 100.0 - 0.7));
    ASSERT_NEAR(values.at("belt/ratio"), i, 1e-14);
    ASSERT_NEAR(values.at("belt/slip"), sample.velocity[1] - i * sample.velocity[0], 1e-12);
  }
}

TEST(Quantities, OfInputsAreInForceAfterHoldAndClamp) {
  Simulation simulation(makeScene());
  for (int n = 0; n <= 120; ++n) {
    simulation.advanceTo(n / 100.0);
    commandAt(simulation, n);
    const auto values = valuesOf(simulation, QuantityGroup::kInputs);
    const double lagged = n <= 40 ? 4.0 : 10.0 - 6.0 * std::exp(-(n / 100.0 - 0.4) / 0.2);
    ASSERT_NEAR(values.at("engine/torque"), lagged, 1e-13 * 10) << n;
    ASSERT_NEAR(values.at("ratio"), n <= 70 ? 0.5 : 0.5 + 0.5 * (n / 100.0 - 0.7), 1e-14) << n;
  }
}

TEST(Quantities, OfTheSceneAreItsFormulasAndOneWithoutAValueStopsNothing) {
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    Simulation simulation(makeScene(principle));
    for (int n = 0; n <= 100; ++n) {
      simulation.advanceTo(n / 100.0);
      const Sample sample = simulation.sample();
      const auto values = valuesOf(simulation, QuantityGroup::kOutputs);
      ASSERT_TRUE(simulation.status().ok());
      ASSERT_NEAR(values.at("ratio_now"), 2.0 * sample.velocity[1] / sample.velocity[0], 1e-14);
      ASSERT_NEAR(values.at("jolt"),
                  sample.acceleration[0] - 3.0 * sample.acceleration[1] + n / 100.0, 1e-12);
      ASSERT_TRUE(std::isnan(values.at("no_value")));
    }
  }
}

TEST(Quantities, ChangeNoBitOfTheMotion) {
  Simulation asked(makeScene());
  Simulation alone(makeScene());
  std::vector<double> values(100);
  for (int n = 0; n <= 200; ++n) {
    for (Simulation* simulation : {&asked, &alone}) {
      simulation->advanceTo(n / 100.0);
      commandAt(*simulation, n);
    }
    for (const QuantityGroup group : kQuantityGroups) asked.calcQuantities(group, values.data());
    if (n % 10 != 0) continue;
    ASSERT_EQ(std::memcmp(&asked.sample(), &alone.sample(), sizeof(Sample)), 0) << n;
  }
  EXPECT_EQ(asked.statistics().steps, alone.statistics().steps);
}

// --- elements from elsewhere ---------------------------------------------------------------------

/// Names its outputs as it is told.
class Talkative : public Torque {
 public:
  explicit Talkative(std::vector<std::string> names) : names_(std::move(names)) {}

 private:
  void build(LawContext& scene) override {
    const Shaft a = scene.shaftAt(0);
    const Shaft b = scene.shaftAt(1);
    scene.apply(b, 0.5);
    scene.apply(a, -a.velocity);
    double number = 0.0;
    for (const std::string& name : names_) scene.output(name, b.acceleration + number++);
  }
  std::vector<std::string> names_;
};

class TalkativeFactory : public BuiltinComponentFactory {
 public:
  explicit TalkativeFactory(TorquePtr torque) : torque_(std::move(torque)) {}
  TorquePtr createTorque(const std::string& /*type*/) override { return torque_; }

 private:
  TorquePtr torque_;
};

Scene sceneWith(std::vector<std::string> names) {
  TalkativeFactory factory(std::make_shared<Talkative>(std::move(names)));
  return readScene(readYamlText("shafts: [a, b, c]\na: {inertia: 1}\nb: {inertia: 2}\n"
                                "c: {inertia: 1}\ntorques: [it]\nit: {type: test/Talkative}\n"
                                "initial: {velocity: [3, 2, 1]}\n",
                                "test"),
                   factory);
}

std::string refusalOf(std::vector<std::string> names) {
  return test::messageOf([&] { sceneWith(std::move(names)); });
}

TEST(Quantities, OfAPluginComeWithItsOwnOutputs) {
  Simulation simulation(sceneWith({"first", "second"}));
  EXPECT_EQ(simulation.quantityNames(QuantityGroup::kElements),
            (std::vector<std::string>{"it/a/torque", "it/b/torque", "it/power", "it/first",
                                      "it/second"}));
  const auto values = valuesOf(simulation, QuantityGroup::kElements);
  EXPECT_EQ(values.at("it/a/torque"), -3.0);
  EXPECT_EQ(values.at("it/b/torque"), 0.5);
  EXPECT_EQ(values.at("it/power"), -9.0 + 1.0);
  EXPECT_EQ(values.at("it/first"), 0.25);
  EXPECT_EQ(values.at("it/second"), 1.25);
}

TEST(Quantities, ThatAPluginStatesWronglyAreErrorsAtLoad) {
  EXPECT_EQ(refusalOf({"slip"}), "");
  for (const char* name : {"power", "a slip", "", "1st", "slip"}) {
    const std::string message = refusalOf({"slip", name});
    EXPECT_NE(message.find("it: states an output '" + std::string(name) + "' (outputNames)"),
              std::string::npos)
        << message;
  }
}

}  // namespace
}  // namespace variator_sim
