// States, variables, events and controllers of scenes, against closed forms.
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"
#include "variator_sim/trim.h"

namespace variator_sim {
namespace {

using test::sceneText;

std::map<std::string, double> valuesOf(Simulation& simulation, QuantityGroup group) {
  const std::vector<std::string>& names = simulation.quantityNames(group);
  std::vector<double> values(names.size());
  simulation.calcQuantities(group, values.data());
  std::map<std::string, double> named;
  for (std::size_t i = 0; i < names.size(); ++i) named[names[i]] = values[i];
  return named;
}
double stateOf(Simulation& simulation, const std::string& name) {
  return valuesOf(simulation, QuantityGroup::kStates).at(name);
}
double variableOf(Simulation& simulation, const std::string& name) {
  return valuesOf(simulation, QuantityGroup::kVariables).at(name);
}
Simulation simulate(const std::string& yaml) {
  return Simulation(test::sceneFromText(yaml));
}

// J w' = -k (1 - a T) w,  c T' = k (1 - a T) w^2:  c T = J/2 (w_0^2 - w^2), and of y = w^2
//     y' = -y (p + q y),  p = 2k/J (1 - b w_0^2),  q = 2k/J b,  b = a J / (2 c)
const std::string kBrake =
    sceneText("load 2", {"brake on load: -0.7*w1*(1 - 0.002*temperature)"},
              "states: [temperature]\ntemperature: {rate: \"-brake_power/500\"}\n"
              "initial: {velocity: [100]}");
double squareOfSpeed(double t) {
  const double b = 0.002 * 2.0 / 1000.0;
  const double p = 0.7 * (1.0 - b * 1e4);
  const double q = 0.7 * b;
  const double decay = std::exp(-p * t);
  return p * 1e4 * decay / (p + q * 1e4 * (1.0 - decay));
}

TEST(States, HeatABrakeThatWeakens) {
  Simulation simulation = simulate(kBrake);
  for (int n = 1; n <= 20; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.3 * n).ok());
    const double y = squareOfSpeed(0.3 * n);
    EXPECT_NEAR(simulation.sample().velocity[0], std::sqrt(y), 1e-8);
    EXPECT_NEAR(stateOf(simulation, "temperature"), (1e4 - y) / 500.0, 1e-8);
  }
}

TEST(States, OfWhatOnlyCountsLeaveTheMotionAsItIs) {
  const std::string scene =
      sceneText("a 1, b 2",
                {"spring = ElasticCoupling, shafts: [a, b], stiffness: 50, damping: 0.1",
                 "drag on b: 3 - 0.2*w2"},
                "initial: {velocity: [5, 0]}");
  Simulation plain = simulate(scene);
  Simulation counted = simulate(scene + R"yaml(states: [way, fuel]
way: {rate: "w_b"}
fuel: {rate: "max(0, drag_power)/1000"}
)yaml");
  plain.trackEnergy(true);
  counted.trackEnergy(true);
  plain.advanceTo(7.0);
  ASSERT_TRUE(counted.advanceTo(7.0).ok()) << counted.describeStatus();
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(counted.sample().velocity[i], plain.sample().velocity[i], 1e-7);
    EXPECT_NEAR(counted.sample().angle[i], plain.sample().angle[i], 1e-7);
  }
  EXPECT_NEAR(stateOf(counted, "way"), counted.sample().angle[1], 1e-9);
  // (The motion's work, whose polynomial in a step ends with the order of the series.)
  EXPECT_NEAR(counted.energy().reactions, 0.0, 1e-5);
  EXPECT_NEAR(counted.energy().applied, plain.energy().applied, 1e-5);
}

const std::string kThermostat = sceneText("load 1", {"drag on load: 3*heats - 0.5*w1"}, R"yaml(
variables: [heats]
heats: {initial: 1}
states: [warmth, switches]
warmth: {rate: "0.5*(60*heats - warmth)", initial: 20}
switches: {rate: 0}
events: [cool, heat]
cool: {when: "warmth - 22", direction: rising, set: {heats: 0, switches: "switches + 1"}}
heat: {when: "warmth - 21", direction: falling, set: {heats: 1, switches: "switches + 1"}}
)yaml");

// Between two switches warmth goes to 60 or 0 by exp(-t/2).
TEST(Events, SwitchAThermostatAThousandTimes) {
  Simulation simulation = simulate(kThermostat);
  double instant = 2.0 * std::log(40.0 / 38.0);
  for (int n = 1; n <= 1000; ++n) {
    ASSERT_TRUE(simulation.advanceTo(instant - 1e-9).ok()) << simulation.describeStatus();
    EXPECT_EQ(stateOf(simulation, "switches"), n - 1) << instant;
    ASSERT_TRUE(simulation.advanceTo(instant + 1e-9).ok()) << simulation.describeStatus();
    EXPECT_EQ(stateOf(simulation, "switches"), n) << instant;
    EXPECT_EQ(variableOf(simulation, "heats"), n % 2 == 0 ? 1.0 : 0.0);
    instant += 2.0 * (n % 2 == 1 ? std::log(22.0 / 21.0) : std::log(39.0 / 38.0));
  }
}

TEST(Events, JumpAsCommandsDo) {
  const std::string scene =
      sceneText("a 1, b 2", {"pull on a: 4*gas - 0.1*w1", "drag on b: -0.3*w2 + gas^2",
                             "slip: 0.2*(e2 - 0.6*e1)*(1 + 0.05*e1^2) + w2 - (0.6 + 0.1*gas)*w1"});
  Simulation set = simulate(scene + R"yaml(variables: [gas]
gas: {initial: 1}
events: [rise]
rise: {when: "t - 0.75", set: {gas: 3}}
)yaml");
  Simulation commanded = simulate(scene + "inputs: [gas]\ngas: {topic: gas, initial: 1}\n");
  commanded.advanceTo(0.75);
  commanded.command(0, 3.0);
  for (const double time : {0.75, 1.0, 3.0}) {
    ASSERT_TRUE(set.advanceTo(time).ok()) << set.describeStatus();
    commanded.advanceTo(time);
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(set.sample().acceleration[i], commanded.sample().acceleration[i], 1e-8);
      EXPECT_NEAR(set.sample().velocity[i], commanded.sample().velocity[i], 1e-8);
      EXPECT_NEAR(set.sample().reaction_torque[i], commanded.sample().reaction_torque[i], 1e-7);
    }
  }
}

TEST(Events, GoOnFromASavedState) {
  Simulation simulation = simulate(kThermostat);
  simulation.advanceTo(3.21);
  MotionState state;
  ASSERT_TRUE(simulation.saveState(&state));
  Simulation other = simulate(kThermostat);
  EXPECT_EQ(other.setState(state, false), "");
  for (Simulation* const it : {&simulation, &other}) ASSERT_TRUE(it->advanceTo(9.0).ok());
  EXPECT_EQ(stateOf(simulation, "warmth"), stateOf(other, "warmth"));
  EXPECT_EQ(stateOf(simulation, "switches"), stateOf(other, "switches"));
  EXPECT_EQ(simulation.sample().velocity[0], other.sample().velocity[0]);
}

// The same equations, by steps of Runge and Kutta.
TEST(Controllers, HoldASpeedWithinTheirLimits) {
  Simulation simulation = simulate(sceneText(
      "load 1", {"motor on load: speed", "drag on load: -0.5*w1 - 0.01*w1^2"},
      "states: [speed]\nspeed: {type: pid, error: \"10 - w1\", kp: 2, ki: 3, limits: [-8, 8]}"));
  const auto rate = [](const std::array<double, 2>& x) -> std::array<double, 2> {
    const double e = 10.0 - x[0];
    const double v = 2.0 * e + x[1];
    const double u = std::min(8.0, std::max(-8.0, v));
    return {u - 0.5 * x[0] - 0.01 * x[0] * x[0], 3.0 * e + (u - v) / (2.0 / 3.0)};
  };
  const double h = 2e-5;
  std::array<double, 2> x = {0.0, 0.0};
  const auto moved = [&x](double by, const std::array<double, 2>& k) -> std::array<double, 2> {
    return {x[0] + by * k[0], x[1] + by * k[1]};
  };
  for (int n = 1; n <= 300000; ++n) {
    const auto a = rate(x);
    const auto b = rate(moved(0.5 * h, a));
    const auto c = rate(moved(0.5 * h, b));
    const auto d = rate(moved(h, c));
    for (std::size_t i = 0; i < 2; ++i) x[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
    if (n % 50000 != 0) continue;
    ASSERT_TRUE(simulation.advanceTo(h * n).ok()) << simulation.describeStatus();
    EXPECT_NEAR(simulation.sample().velocity[0], x[0], 1e-8);
    EXPECT_NEAR(stateOf(simulation, "speed_integral"), x[1], 1e-8);
  }
}

// --- what observers read -------------------------------------------------------------------------

double outputOf(Simulation& simulation, const std::string& name) {
  return valuesOf(simulation, QuantityGroup::kOutputs).at(name);
}

const char* const kObserved = R"yaml(
outputs: [R1, R2, Rr1, Rr2, j1st, L, twice]
R1: {expression: R_a}
R2: {expression: R_b}
Rr1: {expression: Rr_a}
Rr2: {expression: Rr_b}
j1st: {expression: j_a}
L: {expression: belt_multiplier}
twice: {expression: "2*j1st - 2*j_a + R1 + L"}
)yaml";

/// Compares outputs with the sample, and j with the difference of accelerations.
void expectWhatSamplesTell(const std::string& scene) {
  Simulation simulation = simulate(scene + kObserved);
  for (const double time : {0.3, 0.9, 1.7}) {
    simulation.advanceTo(time - 1e-4);
    const double before = simulation.sample().acceleration[0];
    ASSERT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
    const Sample now = simulation.sample();
    const std::map<std::string, double> told = valuesOf(simulation, QuantityGroup::kOutputs);
    const auto expectNear = [](double value, double expected) {
      EXPECT_NEAR(value, expected, 1e-8 * (1.0 + std::abs(expected)));
    };
    expectNear(told.at("R1"), now.reaction_torque[0]);
    expectNear(told.at("R2"), now.reaction_torque[1]);
    expectNear(told.at("Rr1"), now.reaction_torque_rate[0]);
    expectNear(told.at("Rr2"), now.reaction_torque_rate[1]);
    expectNear(told.at("L"), now.multiplier[0]);
    expectNear(told.at("twice"), now.reaction_torque[0] + now.multiplier[0]);
    simulation.advanceTo(time + 1e-4);
    const double difference = (simulation.sample().acceleration[0] - before) / 2e-4;
    EXPECT_NEAR(told.at("j1st"), difference, 1e-4 * (1.0 + std::abs(difference)));
  }
}

const char* const kTwoShafts = R"yaml(
shafts: [a, b]
a: {inertia: {mean: 1, harmonics: [{order: 2, cos: 0.2}]}}
b: {inertia: 2}
torques: [pull, drag]
pull: {type: variator_sim/ExpressionTorque, shaft: a, torque: "4 + heat - 0.1*w1 + sin(t)"}
drag: {type: variator_sim/ExpressionTorque, shaft: b, torque: "-0.3*w2 + 0.1*phi1"}
states: [heat]
heat: {rate: "0.1*w1 - 0.2*heat + 0.01*R_a + 0.01*pull_torque", initial: 1}
constraints: [belt]
)yaml";
const char* const kSlip = R"yaml(
belt: {type: variator_sim/ExpressionConstraint, order: 2,
  expression: "0.2*(e2 - 0.6*e1)*(1 + 0.05*e1^2) + w2 - (0.6 + 0.1*heat)*w1"}
)yaml";
const char* const kSway = R"yaml(
belt: {type: variator_sim/ExpressionConstraint, order: 1, expression: "w2 - (0.6 + 0.1*sin(t))*w1"}
)yaml";

TEST(Observers, AreToldReactionsTheirRatesAndMultipliers) {
  for (const char* const belt : {kSlip, kSway}) {
    for (const char* const principle : {"principle: generalized_gauss", "principle: gauss"}) {
      SCOPED_TRACE(std::string(belt) + principle);
      expectWhatSamplesTell(kTwoShafts + std::string(belt) + principle);
    }
  }
}

const std::string kClutch =
    sceneText("a 1, b 2, c 1",
              {"pull on a: 20 + 15*t", "clutch = Clutch, shafts: [a, b], capacity: 60",
               "drag on b: -0.3*w2", "belt = KinematicRatio, shafts: [b, c], ratio: 0.5"},
              "initial: {velocity: [15, 0, 0]}");

// The clutch slides, sticks and lets go again; while it sticks its torque on a is that of
// R' = C' Lambda, and of the sum of the inertias.
TEST(Observers, AreToldElementsThatHold) {
  for (const char* const principle : {"principle: generalized_gauss\n", "principle: gauss\n"}) {
    SCOPED_TRACE(principle);
    Simulation simulation = simulate(kClutch + principle + kObserved + R"yaml(
states: [heat, held, sides]
heat: {rate: "-clutch_power"}
held: {rate: "if(abs(clutch_mode) < 0.5, 1, 0)"}
sides: {rate: 0}
variables: [slip_at, passed]
slip_at: {initial: -1}
passed: {initial: 0}
events: [stick, pass]
stick: {when: "abs(clutch_mode) - 0.5", set: {sides: "sides + 1", slip_at: "clutch_slip"}}
pass: {when: "clutch_torque + 50", direction: falling, set: {passed: t}}
)yaml");
    bool was_held = false;
    for (int n = 1; n <= 60; ++n) {
      ASSERT_TRUE(simulation.advanceTo(0.1 * n).ok()) << simulation.describeStatus();
      const std::map<std::string, double> elements = valuesOf(simulation, QuantityGroup::kElements);
      EXPECT_NEAR(stateOf(simulation, "heat"), elements.at("clutch/heat"), 1e-8);
      was_held = was_held || elements.at("clutch/mode") == 0.0;
      const Sample& now = simulation.sample();
      EXPECT_NEAR(outputOf(simulation, "R1"), now.reaction_torque[0], 1e-9);
      EXPECT_NEAR(outputOf(simulation, "Rr1"), now.reaction_torque_rate[0], 1e-7);
      EXPECT_NEAR(outputOf(simulation, "L"), now.multiplier[0], 1e-7);
    }
    EXPECT_TRUE(was_held);
    EXPECT_EQ(stateOf(simulation, "sides"), 2.0);
    EXPECT_NEAR(variableOf(simulation, "slip_at"), 0.0, 1e-9);
    // T = a + (b + c/4) of (20 + 15 t - 0.3 w) / (1 + 2.25) with the drag: 2.25 pull + 0.3 w
    simulation.reset();
    ASSERT_TRUE(simulation.advanceTo(6.0).ok());
    const double at = variableOf(simulation, "passed");
    simulation.reset();
    simulation.advanceTo(at);
    const double pull = 20.0 + 15.0 * at;
    const double T = (2.25 * pull + 0.3 * simulation.sample().velocity[0]) / 3.25;
    EXPECT_NEAR(T, 50.0, 1e-6);
  }
}

const std::string kOfReactions =
    sceneText("a, b, c 4",
              {"drive on a: 5 - 0.1*t", "load on b: -2*w_b",
               "one = KinematicRatio, shafts: [a, b], ratio: 0.5",
               "two = KinematicRatio, shafts: [b, c], ratio: 3"},
              "outputs: [L, R, Rr]\nL: {expression: one_multiplier}\nR: {expression: R_b}\n"
              "Rr: {expression: Rr_b}");

TEST(Observers, AreToldShaftsWithoutInertia) {
  for (const char* const principle : {"generalized_gauss", "gauss"}) {
    Simulation simulation =
        simulate(kOfReactions + "a: {inertia: 1}\nb: {inertia: 0}\nprinciple: " + principle);
    ASSERT_TRUE(simulation.advanceTo(1.0).ok());
    const Sample& now = simulation.sample();
    EXPECT_NEAR(outputOf(simulation, "L"), now.multiplier[0], 1e-9);
    EXPECT_NEAR(outputOf(simulation, "R"), now.reaction_torque[1], 1e-9);
    EXPECT_NEAR(outputOf(simulation, "Rr"), now.reaction_torque_rate[1], 1e-9);
  }
}

TEST(Observers, AreRefusedReactionsOfInertiasByFormulas) {
  const std::string fault = test::messageOf(
      [&] { simulate(kOfReactions + "a: {inertia: \"2 + sin(phi_b)\"}\nb: {inertia: 1}\n"); });
  EXPECT_NE(fault.find("beside inertias that are formulas"), std::string::npos) << fault;
}

TEST(Observers, AreRefusedWhereRatesWouldNeedThemselves) {
  const std::string scene = kTwoShafts + std::string(kSway);
  const auto faultOf = [](const std::string& yaml) {
    return test::messageOf([&] { test::sceneFromText(yaml); });
  };
  const auto with = [&](const std::string& formula) {
    std::string changed = scene;
    return changed.replace(changed.find("0.01*R_a"), 8, formula);
  };
  EXPECT_NE(faultOf(with("j_a")).find("heat/rate: reads a jerk"), std::string::npos);
  EXPECT_NE(faultOf(with("belt_multiplier")).find("allowed in when, set"), std::string::npos);
  EXPECT_EQ(faultOf(with("belt_multiplier") + "principle: gauss"), "");
}

// --- rest, trim, errors, saved states ------------------------------------------------------------

// w' = 2 - w, z' = w - z/10, and fuel, which only counts.
const std::string kSlowState =
    sceneText("load 1", {"drive on load: 2 - w1 + 0*z"},
              "states: [z, fuel]\nz: {rate: \"w1 - z/50\"}\nfuel: {rate: 0.25}");

TEST(States, ThatTheMotionReadsKeepItAwake) {
  std::string read = kSlowState + "initial: {velocity: [2]}\n";
  read.replace(read.find("2 - w1"), 6, "-w1");
  std::string counted = read;
  counted.replace(counted.find(" + 0*z"), 6, "");
  counted.replace(counted.find("w1 - z/50"), 9, "w1 + 1");
  for (const bool reads : {true, false}) {
    Simulation simulation = simulate(reads ? read : counted);
    ASSERT_TRUE(simulation.advanceTo(60.0).ok());
    EXPECT_EQ(simulation.isSleeping(), !reads);
    // (A state that only counts goes on exactly.)
    EXPECT_NEAR(stateOf(simulation, "fuel"), 15.0, 1e-12);
  }
}

TEST(States, HaveEstimatedErrors) {
  Simulation simulation = simulate(kBrake + "solver: {relative_tolerance: 1e-6}\n");
  simulation.estimateErrors(true);
  for (int n = 1; n <= 10; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.3 * n).ok());
    const Sample& now = simulation.sample();
    const double exact = (1e4 - squareOfSpeed(0.3 * n)) / 500.0;
    const double error = std::abs(stateOf(simulation, "temperature") - exact);
    EXPECT_NEAR(now.state_error[0], error, 0.1 * error + 1e-11);
  }
}

TEST(Events, AreWatchedFromTheSavedSigns) {
  const std::string scene = sceneText("load 1", {"drive on load: 3*lit - w1"}, R"yaml(
states: [x]
x: {rate: 1, initial: -1}
variables: [lit]
lit: {initial: 0}
events: [rise]
rise: {when: "x*(1 + w1)", direction: rising, set: {lit: 1}}
)yaml");
  Simulation simulation = simulate(scene);
  simulation.advanceTo(0.5);
  MotionState state;
  ASSERT_TRUE(simulation.saveState(&state));
  EXPECT_EQ(state.history.armed[0], -1);
  const Scene read = test::sceneFromText(scene);
  const MotionState again = readMotionState(toTree(state, read), read, MotionState{});
  EXPECT_EQ(again.history.armed[0], -1);
  Simulation other = simulate(scene);
  ASSERT_EQ(other.setState(again, false), "");
  for (Simulation* const it : {&simulation, &other}) ASSERT_TRUE(it->advanceTo(2.0).ok());
  EXPECT_EQ(variableOf(simulation, "lit"), 1.0);
  EXPECT_EQ(variableOf(other, "lit"), 1.0);
  EXPECT_EQ(simulation.sample().velocity[0], other.sample().velocity[0]);
}

TEST(States, AreTrimmedToRestOrLeftFree) {
  const std::string scene = kSlowState;
  const auto trimmed = [](const std::string& text) {
    const TrimResult result = trim(test::sceneFromText(text), {});
    EXPECT_EQ(result.states.size(), 1U) << result.message;
    return result.states.empty() ? OperatingPoint{} : result.states[0].point;
  };
  EXPECT_NEAR(trimmed(scene).input[0], 100.0, 1e-9);  // z = 50 w
  std::string is_free = scene;
  is_free.replace(is_free.find("rate: \"w1 - z/50\""), 17, "rate: \"w1 - z/50\", trim: free");
  EXPECT_EQ(trimmed(is_free).input[0], 0.0);
  EXPECT_NEAR(trimmed(is_free).velocity[0], 2.0, 1e-9);
  std::string at_rest = scene;
  at_rest.replace(at_rest.find("rate: 0.25"), 10, "rate: \"w1 - 2\", trim: rest");
  EXPECT_NEAR(trimmed(at_rest).velocity[0], 2.0, 1e-9);
}

TEST(Memory, FaultsAreNamed) {
  const auto sections = test::readFaultSections("memory");
  ASSERT_EQ(sections.size(), 1U);
  const std::string shafts = sceneText("drive 1", {"motor on drive: 3 - w1"});
  test::expectFaults(test::readFaults(shafts, sections[0].second),
                     [](const std::string& yaml) { test::sceneFromText(yaml); });
}

}  // namespace
}  // namespace variator_sim
