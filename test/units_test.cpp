// Units: what texts mean in SI units, where they are read, and what is said where they do not fit.
#include "variator_sim/units.h"

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/io/override_text.h"

namespace variator_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;

const char* const kScene = R"(
shafts: [engine, load]
engine: {inertia: 800 g m^2}
load: {inertia: {mean: 2 kg m^2, harmonics: [{order: 2, cos: 1000 g cm^2}]}}
inertia_coupling: [[engine, load, 0.01 kg m^2]]
inputs: [lever]
lever: {topic: lever, hold: second_order_lag, time_constant: 100 ms}
tables: [curve]
curve: {x: [0, 1], values: [0, 1]}
torques: [motor, link, pull, loss]
motor: {type: variator_sim/ExpressionTorque, shaft: engine, torque: 0.1 kN m}
link: {type: variator_sim/ElasticCoupling, shafts: [engine, load], stiffness: 20 N m/deg,
       damping: 1 N*m*s/rad, ratio: 50 %}
pull: {type: variator_sim/CommandedTorque, shaft: load, topic: pull, hold: rate_limit,
       rate: 3 kN m/min, initial: 2 Nm, max: "1 kNm"}
loss: {type: variator_sim/Friction, shaft: load, coulomb: {times: [0, 1 min], values: [3, 4 N m]},
       regularization_speed: 1 rpm}
initial: {velocity: [1500 rpm, "+1500rev/min"], angle: [90 deg, 1 rev]}
outputs: [speed, power, plain]
speed: {expression: w_engine, unit: rpm}
power: {expression: 100*w_engine, unit: kW}
plain: {expression: w_engine}
solver: {maximum_step: 50 ms}
)";

Scene sceneWith(const std::string& override_text) {
  ParameterTree tree = readYamlText(kScene, "test");
  if (!override_text.empty()) applyOverride(tree, override_text);
  BuiltinComponentFactory factory;
  return readScene(tree, factory, nodeNames());
}

TEST(Units, HaveTheirValues) {
  struct Row {
    const char* text;
    double value;
    const char* si;
  };
  for (const Row& row :
       {Row{"rpm", kPi / 30.0, "rad/s"}, Row{"deg", kPi / 180.0, "rad"},
        Row{"km/h", 1.0 / 3.6, "m/s"}, Row{"kW", 1000.0, "N m/s"}, Row{"kWh", 3.6e6, "J"},
        Row{"bar", 1e5, "N/m^2"}, Row{"t", 1000.0, "kg"}, Row{"g/kWh", 1.0 / 3.6e9, "kg/J"},
        Row{"ft lbf", 1.3558179483314004, "J"}, Row{"mph", 0.44704, "m/s"},
        Row{"m s^-2", 1.0, "m/s/s"}, Row{"N*m^2", 1.0, "N m m"}, Row{"um", 1e-6, "m"},
        Row{"%", 0.01, "1"}, Row{"V", 1.0, "W/A"}, Row{"1/min", 1.0 / 60.0, "Hz"},
        Row{"min", 60.0, "s"}, Row{"mohm", 0.001, "V/A"}}) {
    SCOPED_TRACE(row.text);
    const std::optional<UnitText> unit = readUnit(row.text);
    ASSERT_TRUE(unit);
    EXPECT_EQ(unit->unknown, "");
    EXPECT_NEAR(unit->unit.toSi(1.0) / row.value, 1.0, 1e-15);
    EXPECT_EQ(unit->unit.dimension, readUnit(row.si)->unit.dimension);
  }
  // Decimal prefixes divide, so that decimal numbers stay what they are.
  EXPECT_EQ(readUnit("ms")->unit.toSi(9.0), 0.009);
}

TEST(Units, AreNotReadFromOtherTexts) {
  for (const char* text : {"", " ", "m/", "/m", "m//s", "m^", "m^x", "m^99", "J/kg K", "2", "m2",
                           "m+s", "m(s)", "m**2", "w_a", "\xff", "1x"}) {
    EXPECT_FALSE(readUnit(text)) << text;
  }
  EXPECT_EQ(readUnit("N furlong")->unknown, "furlong");
}

TEST(Units, AreTakenWhereKeysDeclareThem) {
  const Scene scene = sceneWith("");
  EXPECT_EQ(scene.inertia(0, 0), 0.8);
  EXPECT_EQ(scene.inertia(0, 1), 0.01);
  EXPECT_EQ(scene.inertia_harmonics[1][0].cosine, 1e-4);
  EXPECT_EQ(scene.solver.maximum_step, 0.05);
  EXPECT_DOUBLE_EQ(scene.initial.velocity[0], 50.0 * kPi);
  EXPECT_DOUBLE_EQ(scene.initial.velocity[1], 50.0 * kPi);
  EXPECT_DOUBLE_EQ(scene.initial.angle[0], 0.5 * kPi);
  EXPECT_DOUBLE_EQ(scene.initial.angle[1], 2.0 * kPi);
  EXPECT_EQ(scene.inputs[0].hold_parameter, 0.1);
  EXPECT_EQ(scene.inputs[1].hold_parameter, 50.0);
  EXPECT_EQ(scene.inputs[1].initial, 2.0);
  EXPECT_EQ(scene.inputs[1].maximum, 1000.0);
  Simulation simulation(scene);
  const double angle = simulation.sample().angle[0] - 0.5 * simulation.sample().angle[1];
  const double slip = simulation.sample().velocity[0] - 0.5 * simulation.sample().velocity[1];
  EXPECT_NEAR(simulation.sample().applied_torque[0],
              100.0 - 20.0 * 180.0 / kPi * angle - 1.0 * slip, 1e-9);
}

TEST(Units, OfOutputsAreThoseTheyAreToldIn) {
  Simulation simulation(sceneWith(""));
  const std::vector<double> values = [&] {
    std::vector<double> told(3);
    simulation.calcQuantities(QuantityGroup::kOutputs, told.data());
    return told;
  }();
  EXPECT_NEAR(values[0], 1500.0, 1e-10);
  EXPECT_NEAR(values[1], 5.0 * kPi, 1e-12);
  EXPECT_NEAR(values[2], 50.0 * kPi, 1e-12);
  EXPECT_EQ(simulation.scene().outputs[0].unit, "rpm");
}

TEST(Units, AreRefusedWhereTheyDoNotFit) {
  const auto sections = test::readFaultSections("units");
  test::expectFaults(test::readFaults("", sections[0].second),
                     [](const std::string& text) { sceneWith(text); });
}

/// Every text of up to a few characters out of those that units are made of ends in a number, or in
/// an error of its key.
TEST(Units, TakeEveryTextOrRefuseIt) {
  const std::string letters = "1.e-+ Nmrads/^*%k";
  unsigned random = 1;
  for (int n = 0; n < 20000; ++n) {
    std::string text = "1";
    for (int i = 0; i < 8; ++i) {
      random = random * 1664525U + 1013904223U;
      text += letters[(random >> 16U) % letters.size()];
    }
    try {
      ParameterReader::toNumber(ParameterTree::text(text), "key", Range::positive("N m/rad"));
    } catch (const SceneError& error) {
      EXPECT_EQ(error.keyPath(), "key");
    }
  }
}

TEST(Units, AreWrittenWithTheirSigns) {
  const auto siOf = [](const std::string& text, double number) {
    return requireUnit(text, "it").toSi(number);
  };
  EXPECT_NEAR(siOf("degC", 20.0), 293.15, 1e-12);
  EXPECT_NEAR(siOf("\u00b0C", 20.0), 293.15, 1e-12);
  EXPECT_NEAR(siOf("W/\u00b0C", 3.0), 3.0, 1e-15);  // a difference
  EXPECT_NEAR(siOf("N\u00b7m/\u00b0", 1.0), 180.0 / kPi, 1e-12);
  EXPECT_NEAR(siOf("g m\u00b2", 800.0), 0.8, 1e-15);
  EXPECT_NEAR(siOf("\u00b5s", 5.0), 5e-6, 1e-20);
  EXPECT_NEAR(siOf("m\u03a9", 5.0), 5e-3, 1e-17);
}

}  // namespace
}  // namespace variator_sim
