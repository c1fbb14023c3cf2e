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
    write("axle.yaml", kAxle);
  }
  ~Parts() override { std::filesystem::remove_all(folder_); }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  /// `path` and `number`: a value to be set before the scene is read.
  Scene read(const std::string& text, const std::string& path = "", double number = 0.0) const {
    ParameterTree tree = readYamlFile(write("scene.yaml", text));
    if (!path.empty()) setValue(tree, path, ParameterTree::real(number));
    BuiltinComponentFactory factory;
    return readScene(tree, factory, nodeNames());
  }

  static constexpr const char* kAxle = R"yaml(
shafts: [in, left, right]
in: {inertia: 0.1}
left: {inertia: 1}
right: {inertia: 1}
inputs: [brake]
brake: {topic: brake, initial: 0.5}
tables: [grip]
grip: {x: [0, 10], values: [1, 3], interpolation: linear}
states: [heat]
heat: {rate: "-left_drag_power", initial: 2}
torques: [left_drag, right_drag]
left_drag: {type: variator_sim/ExpressionTorque, shaft: left, torque: "-c*grip(w_left) - 5*brake*w2", parameters: {c: 0.2}}
right_drag: {type: variator_sim/ExpressionTorque, shaft: right, torque: "-(0.2 + 5*brake)*w_right - load"}
constraints: [differential]
differential: {type: variator_sim/ExpressionConstraint, order: 1, expression: "w_in - 1.5*(w_left + w3)"}
initial: {velocity: [3, 1.5, 0.5]}
outputs: [slip]
slip: {expression: "w_left - w_right"}
tick_rate: 500
)yaml";
  static constexpr const char* kTruck = R"yaml(
shafts: [engine, shaft]
engine: {inertia: 1}
shaft: {inertia: 0.2}
parts: [front, rear]
front: {file: axle.yaml, connect: {in: shaft}}
rear: {file: axle.yaml, connect: {in: shaft}, left: {inertia: 2}}
variables: [load]
load: {initial: 0.3}
torques: [drive]
drive: {type: variator_sim/ExpressionTorque, shaft: engine, torque: "20 - 0.1*w_engine + 0.01*w_front/left*rear/brake"}
constraints: [box]
box: {type: variator_sim/KinematicRatio, shafts: [engine, shaft], ratio: 1}
initial: {velocity: [3, 3]}
outputs: [both]
both: {expression: "w_front/left/w_rear/right"}
)yaml";
  /// The truck in one file; shafts: engine, shaft, front's left and right, rear's.
  static constexpr const char* kWhole = R"yaml(
shafts: [engine, shaft, fl, fr, rl, rr]
engine: {inertia: 1}
shaft: {inertia: 0.4}
fl: {inertia: 1}
fr: {inertia: 1}
rl: {inertia: 2}
rr: {inertia: 1}
tables: [grip]
grip: {x: [0, 10], values: [1, 3], interpolation: linear}
torques: [drive, fl_drag, fr_drag, rl_drag, rr_drag]
drive: {type: variator_sim/ExpressionTorque, shaft: engine, torque: "20 - 0.1*w_engine + 0.005*w_fl"}
fl_drag: {type: variator_sim/ExpressionTorque, shaft: fl, torque: "-0.2*grip(w_fl) - 2.5*w_fl"}
fr_drag: {type: variator_sim/ExpressionTorque, shaft: fr, torque: "-2.7*w_fr - 0.3"}
rl_drag: {type: variator_sim/ExpressionTorque, shaft: rl, torque: "-0.2*grip(w_rl) - 2.5*w_rl"}
rr_drag: {type: variator_sim/ExpressionTorque, shaft: rr, torque: "-2.7*w_rr - 0.3"}
states: [front_heat, rear_heat]
front_heat: {rate: "-fl_drag_power", initial: 2}
rear_heat: {rate: "-rl_drag_power", initial: 2}
constraints: [front, rear, box]
front: {type: variator_sim/ExpressionConstraint, order: 1, expression: "w_shaft - 1.5*(w_fl + w_fr)"}
rear: {type: variator_sim/ExpressionConstraint, order: 1, expression: "w_shaft - 1.5*(w_rl + w_rr)"}
box: {type: variator_sim/KinematicRatio, shafts: [engine, shaft], ratio: 1}
initial: {velocity: [3, 3, 1.5, 0.5, 1.5, 0.5]}
)yaml";
  std::filesystem::path folder_;
};

TEST_F(Parts, MoveAsTheSameMachineInOneFile) {
  Simulation made(read(kTruck));
  Simulation whole(test::sceneFromText(kWhole));
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
  write("truck.yaml", kTruck);
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
  EXPECT_EQ(read(kTruck, "rear/right/inertia", 3.0).inertia(5, 5), 3.0);
  EXPECT_EQ(read(kTruck, "front/in/inertia", 1.0).inertia(1, 1), 0.2 + 1.0 + 0.1);
}

TEST_F(Parts, TellFaultsByTheirPath) {
  write("around.yaml", "shafts: [a]\na: {inertia: 1}\nparts: [p]\np: {file: scene.yaml}\n");
  test::expectFaults(test::readFaults("shafts: [s]\ns: {inertia: 1}\nparts: [p]\n",
                                      R"(p: {file: axle.yaml, connect: {inn: s}} => p/connect: 'in'
p: {file: axle.yaml, connect: {in: t}} => p/connect/in: 't' is not a shaft
p: {file: axle.yaml, connect: {in: s, left: s}} => p/connect/left: connected twice
p: {file: axle.yaml, connect: [in]} => p/connect: expected {ITS_SHAFT: SHAFT}
p: {file: axl.yaml} => p/file: cannot be read
p: {connect: {in: s}} => p/file: missing
q: {} => p: missing | in the list parts
p: {file: around.yaml} => p/p/file: part of itself | around.yaml | scene.yaml
p: {file: axle.yaml, left: {inertia: -1}} => p/left/inertia: >= 0
p: {file: axle.yaml, left_drag: {torqe: 1}} => p/left_drag/torqe: 'torque'
p: {file: axle.yaml, torqes: [a]} => p/torqes: 'torques'
p: {file: axle.yaml, principle: gauss} => p/principle: 'generalized_gauss'
p: {file: axle.yaml, initial: {velocity: [1]}} => p/initial/velocity: list of 3
p: {file: axle.yaml, initial: 5} => p/initial: expected a dictionary | 5
p: {file: axle.yaml, inertia_coupling: 5} => p/inertia_coupling: expected a list | 5
p: {file: axle.yaml} / initial: 5 => initial: expected a dictionary | 5
p: {file: axle.yaml} / inertia_coupling: 5 => inertia_coupling: expected a list | 5
p: {file: axle.yaml} / initial: {velocity: [1, 2]} => initial/velocity: list of 1 | s
)"),
                     [&](const std::string& text) { (void)read(text); });
  test::expectFault({"shafts: [s]\ns: {inertia: 1}\nparts: [s]\n", "parts[0]", {"'s' is taken"}},
                    [&](const std::string& text) { (void)read(text); });
  test::expectFault(
      {"shafts: [s]\ns: {inertia: 1}\nparts: [solver]\n", "parts[0]", {"'solver' is taken"}},
      [&](const std::string& text) { (void)read(text); });
}

}  // namespace
}  // namespace variator_sim
