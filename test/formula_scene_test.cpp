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

using Lines = std::vector<std::string>;

const std::string kShafts = "drive 0.5, load 1.2";
const std::string kStart =
    "solver: {relative_tolerance: 1e-10, absolute_tolerance: 1e-10}\ninitial: {velocity: [10, "
    "6]}\n";
const std::string kSlip =
    "variator = SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6";
const std::string kFriction = "friction on load: -0.8*w2";
const std::vector<Command> kCommands = {{0.35, 0, 5.0}, {1.0, 0, -3.0}, {1.75, 0, 8.0}};
const std::vector<Command> kRatios = {{0.35, 0, 0.8}, {1.0, 0, 0.5}, {1.75, 0, 0.7}};

/// An element, and the keys that it needs.
struct Element {
  std::string line;
  std::string keys = "";
};

/// The motions with one and with the other element beside the lines are the same.
void expectSameMotion(const Lines& lines, const Element& one, const Element& other,
                      const std::vector<Command>& commands, double tolerance = 1e-7,
                      const std::string& start = kStart) {
  const auto values = [&](const Element& element) {
    Lines all = lines;
    all.push_back(element.line);
    return play(test::sceneFromText(kShafts, all, start + element.keys), commands);
  };
  const std::vector<double> a = values(one);
  const std::vector<double> b = values(other);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_NEAR(a[i], b[i], tolerance * (1.0 + std::abs(b[i]))) << "value " << i;
  }
}

TEST(SceneFormulas, ReadInputs) {
  for (const std::string hold :
       {"zero_order", "first_order_lag, time_constant: 0.2", "rate_limit, rate: 12",
        "first_order_hold, period: 0.3", "second_order_lag, time_constant: 0.1"}) {
    const std::string input = "topic: lever, hold: " + hold + ", initial: 2, max: 7";
    expectSameMotion({kSlip, kFriction},
                     {"engine = ExpressionTorque, shaft: drive, torque: '3*lever*k', "
                      "parameters: {k: 0.5}",
                      "inputs: [lever]\nlever: {" + input + "}"},
                     {"engine = CommandedTorque, shaft: drive, gain: 1.5, " + input}, kCommands);
  }
}

TEST(SceneFormulas, ReadInputsInConstraintsOfOrder2) {
  for (const std::string principle : {"generalized_gauss", "gauss"}) {
    for (const std::string hold : {"zero_order", "first_order_lag, time_constant: 0.2",
                                   "second_order_lag, time_constant: 0.1"}) {
      const std::string input =
          "topic: lever, hold: " + hold + ", initial: 0.6, min: 0.3, max: 1.2";
      expectSameMotion(
          {kFriction},
          {"variator: 0.2*(e_load - i*e_drive) + w_load - i*w_drive",
           "inputs: [i]\ni: {" + input + "}"},
          {"variator = SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: {" + input +
           "}"},
          kRatios, 1e-7, kStart + "principle: " + principle + "\n");
    }
  }
}

TEST(SceneFormulas, ReadInputsInConstraintsOfOrder1) {
  const std::string input =
      "topic: lever, hold: second_order_lag, time_constant: 0.2, initial: 0.6";
  for (const std::string stepper : {"fehlberg78", "radau", "taylor"}) {
    expectSameMotion(
        {kFriction}, {"variator of order 1: w_load - i*w_drive", "inputs: [i]\ni: {" + input + "}"},
        {"variator = KinematicRatio, shafts: [drive, load], ratio: {" + input + "}"}, kRatios, 1e-6,
        "initial: {velocity: [10, 6]}\n"
        "solver: {relative_tolerance: 1e-9, absolute_tolerance: 1e-9, stepper: " +
            stepper + "}\n");
  }
}

TEST(SceneFormulas, ReadShaftsByName) {
  const std::string b = "b on load: -w2";
  const std::string constraint = "c of order 3: j2 - 0.6*j1 + 4*(e2 - 0.6*e1)";
  expectSameMotion({b, constraint},
                   {"a on drive: -w_drive + sin(phi_load) - 0.1*w2*cos(phi_drive)"},
                   {"a on drive: -w1 + sin(phi2) - 0.1*w2*cos(phi1)"}, {}, 1e-12);
  expectSameMotion({b}, {"c of order 3: j_load - 0.6*j_drive + 4*(e_load - 0.6*e_drive)"},
                   {constraint}, {}, 1e-12);
}

TEST(SceneFormulas, ReadTables) {
  // A motor's curve, and a torque over time.
  expectSameMotion(
      {kSlip},
      {"motor on drive: curve(w_drive)",
       "tables: [curve]\n"
       "curve: {x: [0, 4, 9, 12, 20], values: [30, 24, 8, 3, -20], beyond: linear}"},
      {"motor = MotorCurve, shaft: drive, characteristic: table, table: {speed: [0, 4, 9, 12, 20], "
       "torque: [30, 24, 8, 3, -20], beyond: linear}"},
      {});
  // In two dimensions what is linear along one of them is a product.
  const std::string input =
      "inputs: [u]\nu: {topic: u, hold: rate_limit, rate: 0.4, initial: 0.5}\n";
  expectSameMotion({kSlip},
                   {"motor on drive: map(w_drive, u)",
                    input + "tables: [map]\nmap: {x: [-30, 60], y: [-1, 0, 4], values: "
                            "[[-10, 0, 40], [20, 0, -80]], beyond: linear}"},
                   {"motor on drive: -u*w_drive/3", input}, {{0.5, 0, 1.4}, {1.5, 0, -0.2}});
}

TEST(SceneFormulas, ActOnTwoShafts) {
  expectSameMotion(
      {},
      {"spring = ExpressionTorque, shaft: load, reaction_on: drive, "
       "torque: '40*(phi_drive - phi_load) + 2*(w_drive - w_load)'"},
      {"spring = ElasticCoupling, shafts: [drive, load], stiffness: 40, damping: 2, ratio: 1"}, {});
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

TEST(SceneFormulas, JumpWithAnInputThatTheyCompare) {
  // The jump of an input takes the torque from one branch to the other.
  const std::string input = "inputs: [gear]\ngear: {topic: gear}";
  expectSameMotion({kSlip, kFriction}, {"engine on drive: if(gear > 0.5, 4, -2)", input},
                   {"engine on drive: 6*gear - 2", input},
                   {{0.35, 0, 1.0}, {1.0, 0, 0.0}, {1.75, 0, 1.0}});
}

TEST(SceneFormulas, JumpWhereTheyCompare) {
  // By the state and by an input that moves; sign() makes the same jumps.
  const std::string input =
      "inputs: [lever]\n"
      "lever: {topic: lever, hold: first_order_lag, time_constant: 0.5, initial: 5}";
  expectSameMotion(
      {kSlip, kFriction},
      {"engine on drive: if(w_drive >= 2 + lever, 2, -3*t) + if(lever < 6, 1, -5)", input},
      {"engine on drive: (2 + 3*t)*(1 + sign(w_drive - 2 - lever))/2 - 3*t - 2 - "
       "3*sign(lever - 6)",
       input},
      {{0.35, 0, 2.0}, {1.0, 0, 9.0}});
}

TEST(SceneFormulas, LetAnInputOfOrder3JumpTheJerk) {
  Simulation simulation(
      test::sceneFromText(kShafts, {kFriction, "start of order 3: 0.2*j_drive + e_drive - target"},
                          kStart + "inputs: [target]\ntarget: {topic: target, initial: 1}"));
  simulation.advanceTo(1.0);
  const double before = simulation.sample().acceleration[0];
  simulation.command(0, 3.0);
  EXPECT_NEAR(simulation.sample().acceleration[0], before, 1e-12);
  simulation.advanceTo(1.4);
  ASSERT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  EXPECT_NEAR(simulation.sample().acceleration[0], 3.0 + (before - 3.0) * std::exp(-2.0), 1e-8);
}

// ------------------------------------------------------------------------------------------ errors

const std::string kBase = test::sceneText(kShafts, {}, kStart);

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
  EXPECT_NO_THROW(readText(kBase + withTorque("torque: 'lever*curve(w_drive)'")));
  // Unused inputs and tables are no faults of a scene.
  EXPECT_NO_THROW(readText(kBase + withTorque("torque: 't'")));
  const auto sections = test::readFaultSections("scene_formulas");
  ASSERT_EQ(sections.size(), 2U);
  test::expectFaults(test::readFaults("", sections[0].second),
                     [](const std::string& keys) { readText(kBase + withTorque(keys)); });
  test::expectFaults(test::readFaults(kBase, sections[1].second), readText);
}

TEST(SceneFormulas, TakeSmoothInputsInOrder1) {
  const std::string scene =
      test::sceneText(kShafts, {"gear of order 1: w_load - i*w_drive"}, kStart);
  test::expectFaults(test::readFaults(scene, R"(
inputs: [i] / i: {topic: i, initial: 0.6} => i/hold: read by the constraint 'gear' of order 1
)"),
                     readText);
  EXPECT_NO_THROW(readText(scene + "inputs: [i]\ni: {topic: i, hold: second_order_lag, "
                                   "time_constant: 0.1, initial: 0.6}"));
}

}  // namespace
}  // namespace variator_sim
