// Quantities of elements from elsewhere. (simulate_test.py has those of a scene, and
// test/stress/repeatability_test.cpp that asking for them changes no bit.)

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

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
