// Scenes whose formulas read shafts by name, inputs and tables: the same motions as the laws of
// this package make of them, and what is said about names that mean nothing.

#include "support/faults.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

struct Command {
  double time;
  int input;
  double value;
};

/// The states at every `every` s up to the end, in one list.
std::vector<double> play(Scene scene, const std::vector<Command>& commands, double end = 3.0,
                         double every = 0.1) {
  const int s = scene.shaftCount();
  Simulation simulation(std::move(scene));
  std::vector<double> values;
  std::size_t next = 0;
  for (int n = 0; n * every <= end + 1e-9; ++n) {
    for (; next < commands.size() && commands[next].time <= n * every; ++next) {
      simulation.advanceTo(commands[next].time);
      simulation.command(commands[next].input, commands[next].value);
    }
    simulation.advanceTo(n * every);
    EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
    const Sample& sample = simulation.sample();
    for (int i = 0; i < s; ++i) {
      const auto k = static_cast<std::size_t>(i);
      values.insert(values.end(), {sample.angle[k], sample.velocity[k], sample.acceleration[k],
                                   sample.applied_torque[k], sample.reaction_torque[k]});
    }
  }
  return values;
}

void expectSameMotion(const std::string& one, const std::string& other,
                      const std::vector<Command>& commands, double tolerance = 1e-7) {
  const std::vector<double> a = play(test::sceneFromText(one), commands);
  const std::vector<double> b = play(test::sceneFromText(other), commands);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_NEAR(a[i], b[i], tolerance * (1.0 + std::abs(b[i]))) << "value " << i;
  }
}

const std::string kShafts =
    test::sceneText("drive 0.5, load 1.2", {},
                    "solver: {relative_tolerance: 1e-10, absolute_tolerance: 1e-10}\n"
                    "initial: {velocity: [10, 6]}");
const std::string kSlip = R"yaml(
constraints: [variator]
variator: {type: variator_sim/SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6}
)yaml";
const std::string kFriction =
    "friction: {type: variator_sim/ExpressionTorque, shaft: load, torque: '-0.8*w2'}\n";
const std::vector<Command> kCommands = {{0.35, 0, 5.0}, {1.0, 0, -3.0}, {1.75, 0, 8.0}};

TEST(SceneFormulas, ReadInputs) {
  for (const char* hold :
       {"zero_order", "first_order_lag, time_constant: 0.2", "rate_limit, rate: 12",
        "first_order_hold, period: 0.3", "second_order_lag, time_constant: 0.1"}) {
    const std::string input = std::string("topic: lever, hold: ") + hold + ", initial: 2, max: 7";
    const std::string common = kShafts + kSlip + kFriction + "torques: [engine, friction]\n";
    expectSameMotion(common + "inputs: [lever]\nlever: {" + input +
                         "}\nengine: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "
                         "'3*lever*k', parameters: {k: 0.5}}",
                     common +
                         "engine: {type: variator_sim/CommandedTorque, shaft: drive, gain: "
                         "1.5, " +
                         input + "}",
                     kCommands);
  }
}

TEST(SceneFormulas, ReadInputsInConstraintsOfOrder2) {
  const std::vector<Command> commands = {{0.35, 0, 0.8}, {1.0, 0, 0.5}, {1.75, 0, 0.7}};
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    for (const char* hold : {"zero_order", "first_order_lag, time_constant: 0.2",
                             "second_order_lag, time_constant: 0.1"}) {
      const std::string input =
          std::string("topic: lever, hold: ") + hold + ", initial: 0.6, min: 0.3, max: 1.2";
      const std::string common = kShafts + kFriction + "principle: " + principle +
                                 "\ntorques: [friction]\nconstraints: [variator]\n";
      expectSameMotion(
          common + "inputs: [i]\ni: {" + input +
              "}\nvariator: {type: variator_sim/ExpressionConstraint, order: 2, expression: "
              "'tau*(e_load - i*e_drive) + w_load - i*w_drive', parameters: {tau: 0.2}}",
          common +
              "variator: {type: variator_sim/SlipRatio, shafts: [drive, load], "
              "time_constant: 0.2, ratio: {" +
              input + "}}",
          commands);
    }
  }
}

TEST(SceneFormulas, ReadInputsInConstraintsOfOrder1) {
  const std::vector<Command> commands = {{0.35, 0, 0.8}, {1.0, 0, 0.5}, {1.75, 0, 0.7}};
  const std::string input =
      "topic: lever, hold: second_order_lag, time_constant: 0.2, initial: 0.6";
  for (const char* stepper : {"fehlberg78", "radau", "taylor"}) {
    const std::string shafts = R"yaml(
shafts: [drive, load]
drive: {inertia: 0.5}
load: {inertia: 1.2}
initial: {velocity: [10.0, 6.0]}
torques: [friction]
constraints: [variator]
)yaml" + kFriction + "solver: {relative_tolerance: 1e-9, absolute_tolerance: 1e-9, stepper: " +
                               stepper + "}\n";
    expectSameMotion(
        shafts + "inputs: [i]\ni: {" + input +
            "}\nvariator: {type: variator_sim/ExpressionConstraint, order: 1, expression: "
            "'w_load - i*w_drive'}",
        shafts + "variator: {type: variator_sim/KinematicRatio, shafts: [drive, load], ratio: {" +
            input + "}}",
        commands, 1e-6);
  }
}

TEST(SceneFormulas, ReadShaftsByName) {
  const std::string by_index = R"yaml(
torques: [a, b]
a: {type: variator_sim/ExpressionTorque, shaft: drive, torque: '-w1 + sin(phi2) - 0.1*w2*cos(phi1)'}
constraints: [c]
)yaml";
  const std::string by_name = R"yaml(
torques: [a, b]
a: {type: variator_sim/ExpressionTorque, shaft: drive,
    torque: '-w_drive + sin(phi_load) - 0.1*w2*cos(phi_drive)'}
constraints: [c]
)yaml";
  const std::string b = "b: {type: variator_sim/ExpressionTorque, shaft: load, torque: '-w2'}\n";
  expectSameMotion(
      kShafts + b + by_name +
          "c: {type: variator_sim/ExpressionConstraint, order: 3, expression: 'j_load - "
          "0.6*j_drive + 4*(e_load - 0.6*e_drive)'}",
      kShafts + b + by_index +
          "c: {type: variator_sim/ExpressionConstraint, order: 3, expression: 'j2 - 0.6*j1 + "
          "4*(e2 - 0.6*e1)'}",
      {}, 1e-12);
}

TEST(SceneFormulas, ReadTables) {
  // A motor's curve, and a torque over time.
  const std::string common = kShafts + kSlip + "torques: [motor]\n";
  const std::string lists = "[0, 4, 9, 12, 20]";
  const std::string values = "[30, 24, 8, 3, -20]";
  expectSameMotion(common + "tables: [curve]\ncurve: {x: " + lists + ", values: " + values +
                       ", beyond: linear}\nmotor: {type: variator_sim/ExpressionTorque, shaft: "
                       "drive, torque: 'curve(w_drive)'}",
                   common +
                       "motor: {type: variator_sim/MotorCurve, shaft: drive, "
                       "characteristic: table, table: {speed: " +
                       lists + ", torque: " + values + ", beyond: linear}}",
                   {});
  // In two dimensions what is linear along one of them is a product.
  expectSameMotion(
      common +
          "inputs: [u]\nu: {topic: u, hold: rate_limit, rate: 0.4, initial: 0.5}\ntables: "
          "[map]\nmap: {x: [-30, 60], y: [-1, 0, 4], values: [[-10, 0, 40], [20, 0, -80]], "
          "beyond: linear}\nmotor: {type: variator_sim/ExpressionTorque, shaft: drive, "
          "torque: 'map(w_drive, u)'}",
      common +
          "inputs: [u]\nu: {topic: u, hold: rate_limit, rate: 0.4, initial: 0.5}\nmotor: "
          "{type: variator_sim/ExpressionTorque, shaft: drive, torque: '-u*w_drive/3'}",
      {{0.5, 0, 1.4}, {1.5, 0, -0.2}});
}

TEST(SceneFormulas, ActOnTwoShafts) {
  const std::string common = kShafts + "torques: [spring]\n";
  expectSameMotion(
      common +
          "spring: {type: variator_sim/ExpressionTorque, shaft: load, reaction_on: drive, "
          "torque: '40*(phi_drive - phi_load) + 2*(w_drive - w_load)'}",
      common +
          "spring: {type: variator_sim/ElasticCoupling, shafts: [drive, load], stiffness: "
          "40, damping: 2, ratio: 1}",
      {});
}

/// A motion whose edges depend on inputs, at the given tolerance.
std::vector<double> playEdges(double tolerance) {
  const std::string scene = test::sceneText(
      "drive 0.5, load 1.2",
      {"engine on drive: 5*max(0, lever - w_drive)",
       "friction on load: if(brake > 0.5, -6*tanh(w_load), -0.1*w_load)",
       "clutch = ExpressionTorque, shaft: load, reaction_on: drive, torque: 'clamp(8*(w_drive - "
       "w_load), -6, 6)'"},
      "inputs: [lever, brake]\n"
      "lever: {topic: lever, hold: first_order_lag, time_constant: 0.3, initial: 9}\n"
      "brake: {topic: brake, hold: second_order_lag, time_constant: 0.2}\n"
      "initial: {velocity: [10, 6]}");
  return play(test::withTolerance(test::sceneFromText(scene), tolerance),
              {{0.35, 0, 12.0}, {0.8, 1, 1.0}, {1.3, 0, 7.0}, {2.1, 1, 0.0}});
}

TEST(SceneFormulas, EndStepsWhereInputsCrossEdges) {
  const std::vector<double> coarse = playEdges(1e-7);
  const std::vector<double> fine = playEdges(1e-12);
  for (std::size_t i = 0; i < fine.size(); ++i) {
    ASSERT_NEAR(coarse[i], fine[i], 1e-4 * (1.0 + std::abs(fine[i]))) << "value " << i;
  }
}

TEST(SceneFormulas, TakeFewStepsAcrossEdgesOfInputs) {
  Simulation simulation(test::sceneFromText(kShafts + R"yaml(
inputs: [lever]
lever: {topic: lever, hold: rate_limit, rate: 2, initial: 0}
torques: [engine]
engine: {type: variator_sim/ExpressionTorque, shaft: drive, torque: 'if(lever > 1, 5, -w_drive)'}
)yaml"));
  simulation.command(0, 10.0);
  simulation.advanceTo(3.0);
  ASSERT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  EXPECT_LT(simulation.statistics().steps, 200U);
  // w' = -2 w up to 0.5 s, then w' = 10.
  EXPECT_NEAR(simulation.sample().velocity[0], 10.0 * std::exp(-1.0) + 25.0, 1e-8);
}

TEST(SceneFormulas, JumpWithAnInputThatTheyCompare) {
  // The jump of an input takes the torque from one branch to the other.
  const std::string common = kShafts + kSlip + kFriction + "torques: [engine, friction]\n";
  const std::vector<Command> commands = {{0.35, 0, 1.0}, {1.0, 0, 0.0}, {1.75, 0, 1.0}};
  expectSameMotion(
      common +
          "inputs: [gear]\ngear: {topic: gear}\nengine: {type: "
          "variator_sim/ExpressionTorque, shaft: drive, torque: 'if(gear > 0.5, 4, -2)'}",
      common +
          "inputs: [gear]\ngear: {topic: gear}\nengine: {type: "
          "variator_sim/ExpressionTorque, shaft: drive, torque: '6*gear - 2'}",
      commands);
}

TEST(SceneFormulas, JumpWhereTheyCompare) {
  // By the state and by an input that moves; sign() makes the same jumps.
  const std::string common =
      kShafts + kSlip + kFriction +
      "torques: [engine, friction]\ninputs: [lever]\nlever: {topic: lever, hold: "
      "first_order_lag, time_constant: 0.5, initial: 5}\nengine: {type: "
      "variator_sim/ExpressionTorque, shaft: drive, torque: ";
  expectSameMotion(common + "'if(w_drive >= 2 + lever, 2, -3*t) + if(lever < 6, 1, -5)'}",
                   common +
                       "'(2 + 3*t)*(1 + sign(w_drive - 2 - lever))/2 - 3*t - 2 - 3*sign(lever - "
                       "6)'}",
                   {{0.35, 0, 2.0}, {1.0, 0, 9.0}});
}

TEST(SceneFormulas, LetAnInputOfOrder3JumpTheJerk) {
  Simulation simulation(test::sceneFromText(kShafts + kFriction + R"yaml(
inputs: [target]
target: {topic: target, initial: 1}
torques: [friction]
constraints: [start]
start: {type: variator_sim/ExpressionConstraint, order: 3, expression: '0.2*j_drive + e_drive - target'}
)yaml"));
  simulation.advanceTo(1.0);
  const double before = simulation.sample().acceleration[0];
  simulation.command(0, 3.0);
  EXPECT_NEAR(simulation.sample().acceleration[0], before, 1e-12);
  simulation.advanceTo(1.4);
  ASSERT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  EXPECT_NEAR(simulation.sample().acceleration[0], 3.0 + (before - 3.0) * std::exp(-2.0), 1e-8);
}

TEST(SceneFormulas, EndStepsAtThePointsOfTablesOverTime) {
  // A pulse much narrower than a step, of 2000 h + 2 q h^3/120 N m s with q = -4 2000/h^2 at its
  // top.
  Simulation simulation(test::sceneFromText(kShafts + R"yaml(
tables: [pulse]
pulse: {x: [1, 1.0005, 1.001], values: [0, 2000, 0]}
torques: [engine]
engine: {type: variator_sim/ExpressionTorque, shaft: drive, torque: 'pulse(t)'}
)yaml"));
  simulation.advanceTo(3.0);
  ASSERT_TRUE(simulation.status().ok());
  EXPECT_NEAR(simulation.sample().velocity[0], 10.0 + (2000.0 * 5e-4 * (1.0 - 8.0 / 240.0)) / 0.5,
              1e-6);
}

// ------------------------------------------------------------------------------------------ errors

std::string errorOf(const std::string& yaml) {
  try {
    test::sceneFromText(kShafts + yaml);
  } catch (const SceneError& error) {
    return error.what();
  }
  return "";
}

/// A torque by formula beside an input `lever` and a table `curve`.
std::string withTorque(const std::string& keys) {
  return "inputs: [lever]\nlever: {topic: lever}\ntables: [curve]\ncurve: {x: [0, 1], values: [0, "
         "1]}\ntorques: [it]\nit: {type: variator_sim/ExpressionTorque, shaft: drive, " +
         keys + "}\n";
}

void readText(const std::string& yaml) {
  test::sceneFromText(yaml);
}

TEST(SceneFormulas, NameWhatIsWrong) {
  EXPECT_EQ(errorOf(withTorque("torque: 'lever*curve(w_drive)'")), "");
  // Unused inputs and tables are no faults of a scene.
  EXPECT_EQ(errorOf(withTorque("torque: 't'")), "");
  const auto sections = test::readFaultSections("scene_formulas");
  ASSERT_EQ(sections.size(), 2U);
  test::expectFaults(test::readFaults("", sections[0].second), [](const std::string& keys) {
    test::sceneFromText(kShafts + withTorque(keys));
  });
  test::expectFaults(test::readFaults(kShafts, sections[1].second), readText);
}

TEST(SceneFormulas, TakeSmoothInputsInOrder1) {
  const std::string constraint =
      "constraints: [gear]\ngear: {type: variator_sim/ExpressionConstraint, order: 1, expression: "
      "'w_load - i*w_drive'}\n";
  test::expectFaults(test::readFaults(kShafts + constraint, R"(
inputs: [i] / i: {topic: i, initial: 0.6} => i/hold: read by the constraint 'gear' of order 1
)"),
                     readText);
  EXPECT_EQ(errorOf(constraint + "inputs: [i]\ni: {topic: i, hold: second_order_lag, "
                                 "time_constant: 0.1, initial: 0.6}"),
            "");
}

}  // namespace
}  // namespace variator_sim
