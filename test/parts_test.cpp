// Scenes made of scenes, beside the same machines in one file.
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

class Parts : public testing::Test {
 protected:
  Parts() {
    std::string name =
        (std::filesystem::temp_directory_path() / "variator_sim_parts_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    for (const char* file : {"axle.yaml", "truck.yaml"}) {
      std::filesystem::copy_file(fileOf(file), folder_ / file);
    }
  }
  ~Parts() override { std::filesystem::remove_all(folder_); }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  static std::string fileOf(const std::string& name) {
    return VARIATOR_SIM_TEST_DIR "/parts/" + name;
  }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  Scene read(const std::string& text) const { return readFile(write("scene.yaml", text)); }
  /// `path` and `number`: a value to be set before the scene is read.
  static Scene readFile(const std::string& file, const std::string& path = "",
                        double number = 0.0) {
    ParameterTree tree = readYamlFile(file);
    if (!path.empty()) setValue(tree, path, ParameterTree::real(number));
    BuiltinComponentFactory factory;
    return readScene(tree, factory, nodeNames());
  }

  std::filesystem::path folder_;
};

TEST_F(Parts, MoveAsTheSameMachineInOneFile) {
  Simulation made(readFile(fileOf("truck.yaml")));
  Simulation whole(readFile(fileOf("whole.yaml")));
  const std::vector<std::string> shafts{"engine",      "shaft",     "front/left",
                                        "front/right", "rear/left", "rear/right"};
  EXPECT_EQ(made.scene().shafts, shafts);
  for (int n = 1; n <= 4; ++n) {
    ASSERT_TRUE(made.advanceTo(0.5 * n).ok()) << made.describeStatus();
    ASSERT_TRUE(whole.advanceTo(0.5 * n).ok());
    for (int i = 0; i < 6; ++i) {
      EXPECT_NEAR(made.sample().velocity[i], whole.sample().velocity[i], 1e-10) << shafts[i];
      EXPECT_NEAR(made.sample().reaction_torque[i], whole.sample().reaction_torque[i], 1e-8);
    }
    double heat[2][2];
    made.calcQuantities(QuantityGroup::kStates, heat[0]);
    whole.calcQuantities(QuantityGroup::kStates, heat[1]);
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(heat[0][i], heat[1][i], 1e-9);
  }
  double outputs[3];
  made.calcQuantities(QuantityGroup::kOutputs, outputs);
  EXPECT_EQ(outputs[2], made.sample().velocity[2] / made.sample().velocity[5]);
}

// Names of a part of a part are paths, and a scene that was read can be read again.
TEST_F(Parts, HavePartsOfTheirOwn) {
  const Scene scene = read(R"yaml(
shafts: [hitch]
hitch: {inertia: 5}
parts: [first, second]
first: {file: truck.yaml, connect: {shaft: hitch}}
second: {file: truck.yaml, connect: {engine: hitch}}
torques: [pull]
pull: {type: variator_sim/ExpressionTorque, shaft: hitch, torque: "-w_second/rear/left"}
initial: {velocity: [3]}
)yaml");
  EXPECT_EQ(scene.shaftCount(), 11);
  EXPECT_EQ(scene.shafts[3], "first/front/right");
  EXPECT_EQ(scene.inputs.size(), 10U);  // brake and heat of four axles, the load of two trucks
  EXPECT_EQ(scene.inertia(0, 0), 5.0 + 0.4 + 1.0);
  Simulation simulation(scene);
  ASSERT_TRUE(simulation.advanceTo(1.0).ok()) << simulation.describeStatus();
  BuiltinComponentFactory factory;
  Simulation again(readScene(scene.resolved, factory, nodeNames()));
  ASSERT_TRUE(again.advanceTo(1.0).ok());
  for (int i = 0; i < 11; ++i) {
    EXPECT_EQ(simulation.sample().velocity[i], again.sample().velocity[i]);
  }
}

TEST_F(Parts, HaveTheirValuesSetByPath) {
  EXPECT_EQ(readFile(fileOf("truck.yaml"), "rear/right/inertia", 3.0).inertia(5, 5), 3.0);
  EXPECT_EQ(readFile(fileOf("truck.yaml"), "front/in/inertia", 1.0).inertia(1, 1), 0.2 + 1.0 + 0.1);
}

TEST_F(Parts, TellFaultsByTheirPath) {
  write("around.yaml", "shafts: [a]\na: {inertia: 1}\nparts: [p]\np: {file: scene.yaml}\n");
  const auto sections = test::readFaultSections("parts");
  test::expectFaults(
      test::readFaults("shafts: [s]\ns: {inertia: 1}\nparts: [p]\n", sections.at(0).second),
      [&](const std::string& text) { (void)read(text); });
  test::expectFault({"shafts: [s]\ns: {inertia: 1}\nparts: [s]\n", "parts[0]", {"'s' is taken"}},
                    [&](const std::string& text) { (void)read(text); });
  test::expectFault(
      {"shafts: [s]\ns: {inertia: 1}\nparts: [solver]\n", "parts[0]", {"'solver' is taken"}},
      [&](const std::string& text) { (void)read(text); });
}

}  // namespace
}  // namespace variator_sim
