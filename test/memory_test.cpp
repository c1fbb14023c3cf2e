// States, variables, events and controllers of scenes, against closed forms.
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/errors.h"

namespace variator_sim {
namespace {

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
const char* const kBrake = R"yaml(
shafts: [load]
load: {inertia: 2}
torques: [brake]
brake: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.7*w1*(1 - 0.002*temperature)"}
states: [temperature]
temperature: {rate: "-brake_power/500"}
initial: {velocity: [100]}
)yaml";

TEST(States, HeatABrakeThatWeakens) {
  Simulation simulation = simulate(kBrake);
  const double b = 0.002 * 2.0 / 1000.0;
  const double p = 0.7 * (1.0 - b * 1e4);
  const double q = 0.7 * b;
  for (int n = 1; n <= 20; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.3 * n).ok());
    const double decay = std::exp(-p * 0.3 * n);
    const double y = p * 1e4 * decay / (p + q * 1e4 * (1.0 - decay));
    EXPECT_NEAR(simulation.sample().velocity[0], std::sqrt(y), 1e-8);
    EXPECT_NEAR(stateOf(simulation, "temperature"), (1e4 - y) / 500.0, 1e-8);
  }
}

TEST(States, OfWhatOnlyCountsLeaveTheMotionAsItIs) {
  const std::string scene = R"yaml(
shafts: [a, b]
a: {inertia: 1}
b: {inertia: 2}
torques: [spring, drag]
spring: {type: variator_sim/ElasticCoupling, shafts: [a, b], stiffness: 50, damping: 0.1}
drag: {type: variator_sim/ExpressionTorque, shaft: b, torque: "3 - 0.2*w2"}
initial: {velocity: [5, 0]}
)yaml";
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

const char* const kThermostat = R"yaml(
shafts: [load]
load: {inertia: 1}
torques: [drag]
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "3*heats - 0.5*w1"}
variables: [heats]
heats: {initial: 1}
states: [warmth, switches]
warmth: {rate: "0.5*(60*heats - warmth)", initial: 20}
switches: {rate: 0}
events: [cool, heat]
cool: {when: "warmth - 22", direction: rising, set: {heats: 0, switches: "switches + 1"}}
heat: {when: "warmth - 21", direction: falling, set: {heats: 1, switches: "switches + 1"}}
)yaml";

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

TEST(Events, OfOneInstantActInTheOrderOfTheList) {
  Simulation simulation = simulate(R"yaml(
shafts: [load]
load: {inertia: 1}
variables: [a, b, c]
a: {initial: 1}
b: {initial: 2}
c: {initial: 0}
events: [swap, note, never]
swap: {when: "t - 1", set: {a: b, b: a}}
note: {when: "2*t - 2", set: {c: "10*a + b"}}
never: {when: "1 - t", direction: rising, set: {a: 7}}
)yaml");
  ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << simulation.describeStatus();
  EXPECT_EQ(variableOf(simulation, "a"), 2.0);
  EXPECT_EQ(variableOf(simulation, "b"), 1.0);
  EXPECT_EQ(variableOf(simulation, "c"), 21.0);
}

TEST(Events, FollowCommandsAndWhatOthersSet) {
  Simulation simulation = simulate(R"yaml(
shafts: [load]
load: {inertia: 1}
inputs: [button]
button: {topic: button}
variables: [lamp, told]
lamp: {initial: 0}
told: {initial: 0}
events: [press, tell]
press: {when: "button - 0.5", direction: rising, set: {lamp: "1 - lamp"}}
tell: {when: "lamp - 0.5", set: {told: "told + 1"}}
)yaml");
  const auto press = [&](double time, double value) {
    simulation.advanceTo(time);
    simulation.command(0, value);
  };
  press(0.5, 1.0);
  press(0.6, 0.0);
  EXPECT_EQ(variableOf(simulation, "lamp"), 1.0);
  press(0.7, 1.0);
  ASSERT_TRUE(simulation.advanceTo(1.0).ok()) << simulation.describeStatus();
  EXPECT_EQ(variableOf(simulation, "lamp"), 0.0);
  EXPECT_EQ(variableOf(simulation, "told"), 2.0);
}

// Under generalized_gauss R goes on from where it was, as behind a command.
TEST(Events, JumpAsCommandsDo) {
  const std::string scene = R"yaml(
shafts: [a, b]
a: {inertia: 1}
b: {inertia: 2}
torques: [pull, drag]
pull: {type: variator_sim/ExpressionTorque, shaft: a, torque: "4*gas - 0.1*w1"}
drag: {type: variator_sim/ExpressionTorque, shaft: b, torque: "-0.3*w2 + gas^2"}
constraints: [slip]
slip: {type: variator_sim/ExpressionConstraint, order: 2,
  expression: "0.2*(e2 - 0.6*e1)*(1 + 0.05*e1^2) + w2 - (0.6 + 0.1*gas)*w1"}
)yaml";
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

TEST(Events, ThatSetThemselvesOffAgainStopByName) {
  Simulation simulation = simulate(R"yaml(
shafts: [load]
load: {inertia: 1}
states: [x]
x: {rate: 1}
events: [flip]
flip: {when: "x - 1", set: {x: "1 - 2*(x - 1) + if(x < 1, 1e-3, -1e-3)"}}
)yaml");
  EXPECT_FALSE(simulation.advanceTo(3.0).ok());
  EXPECT_EQ(simulation.status().reason, StopReason::kChattering);
  EXPECT_NE(simulation.describeStatus().find("'flip'"), std::string::npos)
      << simulation.describeStatus();
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
  Simulation simulation = simulate(R"yaml(
shafts: [load]
load: {inertia: 1}
torques: [motor, drag]
motor: {type: variator_sim/ExpressionTorque, shaft: load, torque: speed}
drag: {type: variator_sim/ExpressionTorque, shaft: load, torque: "-0.5*w1 - 0.01*w1^2"}
states: [speed]
speed: {type: pid, error: "10 - w1", kp: 2, ki: 3, limits: [-8, 8]}
)yaml");
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

TEST(Memory, FaultsAreNamed) {
  const auto sections = test::readFaultSections("memory");
  ASSERT_EQ(sections.size(), 1U);
  const std::string shafts =
      "shafts: [drive]\ndrive: {inertia: 1}\ntorques: [motor]\nmotor: {type: "
      "variator_sim/ExpressionTorque, shaft: drive, torque: '3 - w1'}\n";
  test::expectFaults(test::readFaults(shafts, sections[0].second),
                     [](const std::string& yaml) { test::sceneFromText(yaml); });
}

}  // namespace
}  // namespace variator_sim
