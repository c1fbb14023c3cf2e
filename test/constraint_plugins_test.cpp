// The ready-made constraints against the same formulas typed into a scene, in rows and in motion;
// jumps of a commanded ratio against fast ramps; derivatives of the rows by the state; faults of
// their keys; that the documentation's examples are read; and that formulas are loaded whose
// derivatives differences cannot resolve.

#include <fstream>
#include <set>

#include "support/count_allocations.h"
#include "support/documents.h"
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/constraint.h"
#include "variator_sim/table.h"

namespace variator_sim {
namespace {

/// Two shafts, a motor, a propeller, one constraint `it`.
std::string sceneText(const std::string& constraint, const std::string& rest = "") {
  return test::sceneText(
      "drive 0.8, load 2",
      {"motor on drive: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)", "propeller on load: -0.02*w2^2",
       "command on drive from torque", "it = " + constraint},
      rest);
}

Scene sceneOf(const std::string& constraint, const std::string& rest = "") {
  return test::withTolerance(test::sceneFromText(sceneText(constraint, rest)), 1e-11);
}

struct Twin {
  std::string plugin;
  std::string formula;
};

/// The rows of test/constraint_twins.txt.
const std::vector<Twin> kTwins = [] {
  std::vector<Twin> twins;
  std::ifstream file(VARIATOR_SIM_TEST_DIR "/constraint_twins.txt");
  for (std::string line; std::getline(file, line);) {
    const std::vector<std::string> sides = test::split(line, " => ");
    if (sides.size() == 2 && line[0] != '#') twins.push_back({sides[0], sides[1]});
  }
  return twins;
}();

TEST(Plugins, HaveTheRowsOfTheirFormulas) {
  ASSERT_FALSE(kTwins.empty());
  for (const Twin& twin : kTwins) {
    SCOPED_TRACE(twin.plugin);
    const Scene a = sceneOf(twin.plugin);
    const Scene b = sceneOf("ExpressionConstraint, " + twin.formula);
    const Constraint& plugin = *a.constraints[0];
    const Constraint& formula = *b.constraints[0];
    ASSERT_EQ(plugin.order(), formula.order());
    EXPECT_EQ(plugin.nonlinearAccelerations(), formula.nonlinearAccelerations());
    for (int n = 0; n < 5; ++n) {
      const double angle[] = {0.2 * n, 1.0 - n};
      const double velocity[] = {4.0 + 0.7 * n, 3.1 - 0.9 * n};
      const double acceleration[] = {1.3 - n, 0.4 + 0.8 * n};
      const double input[] = {0.0};
      const StateView x{0.3 * n, angle, velocity, acceleration, input, input, input};
      double C[2][2];
      double c0[2];
      plugin.calcRow(x, C[0], &c0[0]);
      formula.calcRow(x, C[1], &c0[1]);
      const auto expectC = [&](const char* what) {
        for (int i = 0; i < 2; ++i) {
          EXPECT_NEAR(C[0][i], C[1][i], 1e-12 * std::max(1.0, std::abs(C[1][i]))) << what;
        }
      };
      expectC("row");
      EXPECT_NEAR(c0[0], c0[1], 1e-12 * std::max(1.0, std::abs(c0[1])));
      if (plugin.order() == 3) continue;
      EXPECT_NEAR(plugin.calcResidual(x), formula.calcResidual(x), 1e-12);
      EXPECT_NEAR(plugin.calcResidualAndJacobian(x, C[0]), formula.calcResidualAndJacobian(x, C[1]),
                  1e-12);
      expectC("second-order form");
    }
  }
}

#ifdef VARIATOR_SIM_COUNTS_ALLOCATIONS
TEST(Plugins, AllocateNothing) {
  for (const Twin& twin : kTwins) {
    SCOPED_TRACE(twin.plugin);
    const Scene scene = sceneOf(twin.plugin);
    const Constraint& plugin = *scene.constraints[0];
    const double values[] = {1.0, 2.0};
    const StateView x{0.3, values, values, values, values, values, values};
    double C[2];
    double H[4];
    double c0 = 0.0;
    const long before = allocations;
    plugin.calcRow(x, C, &c0);
    plugin.calcResidual(x);
    if (plugin.order() < 3) plugin.calcResidualAndJacobian(x, C);
    plugin.calcHessian(x, H);
    EXPECT_EQ(allocations, before);
  }
}
#endif

TEST(Plugins, MoveAsTheirFormulas) {
  for (const Twin& twin : kTwins) {
    for (const char* principle : {"generalized_gauss", "gauss"}) {
      SCOPED_TRACE(twin.plugin + ' ' + principle);
      const std::string rest =
          std::string("principle: ") + principle + "\ninitial: {velocity: [5, 3], project: true}\n";
      Simulation plugin(sceneOf(twin.plugin, rest));
      Simulation formula(sceneOf("ExpressionConstraint, " + twin.formula, rest));
      for (int n = 1; n <= 5; ++n) {
        const double t = 0.2 * n;
        ASSERT_TRUE(plugin.advanceTo(t).ok()) << plugin.describeStatus();
        ASSERT_TRUE(formula.advanceTo(t).ok()) << formula.describeStatus();
        const Sample& a = plugin.sample();
        const Sample& b = formula.sample();
        for (int i = 0; i < 2; ++i) {
          ASSERT_NEAR(a.velocity[i], b.velocity[i], 1e-8);
          ASSERT_NEAR(a.acceleration[i], b.acceleration[i], 1e-8);
          ASSERT_NEAR(a.reaction_torque_rate[i], b.reaction_torque_rate[i], 1e-6);
        }
      }
    }
  }
}

// c0 = -(2 i' eps_a + i'' omega_a) of an imposed ratio, by table and by command.
TEST(Plugins, AnImposedRatioEntersWithItsTwoDerivatives) {
  const Scene table = sceneOf(
      "KinematicRatio, shafts: [drive, load], ratio: {times: [0, 2, 5], values: [0.4, 0.8, 0.6]}");
  const ParameterTree tree = readYamlText("x: [0, 2, 5]\ny: [0.4, 0.8, 0.6]", "test");
  ParameterReader reader(tree, "");
  const Table curve =
      Table::read(reader, {{"x", Range::any()}, {"y", Range::any()}}, Table::Beyond::kConstant);
  const Scene commanded = sceneOf(
      "KinematicRatio, shafts: [drive, load], ratio: {topic: ratio, hold: second_order_lag, "
      "time_constant: 0.3, initial: 0.6}");
  const double angle[] = {0.0, 0.0};
  const double velocity[] = {4.0, 3.1};
  const double acceleration[] = {1.3, 0.4};
  for (const double t : {-1.0, 0.5, 1.9, 3.0, 7.0}) {
    const double input[] = {0.0, 0.7 + 0.1 * t};
    const double input_rate[] = {0.0, 0.2};
    const double input_second_rate[] = {0.0, -0.9};
    const StateView x{t, angle, velocity, acceleration, input, input_rate, input_second_rate};
    double C[2];
    double c0;
    table.constraints[0]->calcRow(x, C, &c0);
    EXPECT_NEAR(C[0], -curve.value(t), 1e-14);
    EXPECT_NEAR(c0, -(2.0 * curve.slope(t) * 1.3 + curve.curvature(t) * 4.0), 1e-12);
    commanded.constraints[0]->calcRow(x, C, &c0);
    EXPECT_NEAR(C[0], -input[1], 1e-14);
    EXPECT_NEAR(c0, -(2.0 * 0.2 * 1.3 + -0.9 * 4.0), 1e-12);
  }
}

int inputOf(const Simulation& simulation, const std::string& topic) {
  const auto& inputs = simulation.scene().inputs;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i].topic == topic) return static_cast<int>(i);
  }
  ADD_FAILURE() << topic;
  return -1;
}

// A ratio commanded through a lag of second order is i(t) written down; a torque may jump
// meanwhile.
TEST(Plugins, ACommandedKinematicRatioIsTheRatioOfItsClosedForm) {
  const std::string start = "initial: {velocity: [5, 3], acceleration: [4, 2.4]}\n";
  Simulation commanded(sceneOf(
      "KinematicRatio, shafts: [drive, load], ratio: {topic: ratio, hold: second_order_lag, "
      "time_constant: 0.3, initial: 0.6}",
      start));
  Simulation written(sceneOf(
      "ExpressionConstraint, order: 1, expression: \"w2-(0.9-0.3*(1+t/0.3)*exp(-t/0.3))*w1\"",
      start));
  commanded.command(inputOf(commanded, "ratio"), 0.9);
  for (int n = 0; n <= 20; ++n) {
    const double t = 0.1 * n;
    ASSERT_TRUE(commanded.advanceTo(t).ok()) << commanded.describeStatus();
    ASSERT_TRUE(written.advanceTo(t).ok()) << written.describeStatus();
    if (n == 3 || n == 7) {
      commanded.command(inputOf(commanded, "torque"), 5.0 * n);
      written.command(inputOf(written, "torque"), 5.0 * n);
    }
    const Sample& a = commanded.sample();
    const Sample& b = written.sample();
    for (int i = 0; i < 2; ++i) {
      ASSERT_NEAR(a.velocity[i], b.velocity[i], 1e-8) << t;
      ASSERT_NEAR(a.acceleration[i], b.acceleration[i], 1e-8) << t;
      ASSERT_NEAR(a.reaction_torque[i], b.reaction_torque[i], 1e-7) << t;
    }
  }
}

std::array<double, 2> accelerationAfterRatioStep(const std::string& hold, double duration,
                                                 const char* plugin) {
  Simulation simulation(
      sceneOf(std::string(plugin) + "ratio: {topic: ratio, " + hold + ", initial: 0.6}",
              "initial: {velocity: [5, 3]}\n"));
  EXPECT_TRUE(simulation.advanceTo(0.5).ok()) << simulation.describeStatus();
  simulation.command(inputOf(simulation, "ratio"), 0.9);
  EXPECT_TRUE(simulation.advanceTo(0.5 + duration).ok()) << simulation.describeStatus();
  EXPECT_NEAR(simulation.sample().residual[0], 0.0, 1e-9);
  return {simulation.sample().acceleration[0], simulation.sample().acceleration[1]};
}

TEST(Plugins, AJumpOfACommandedRatioIsTheLimitOfRamps) {
  for (const char* plugin : {"SlipRatio, shafts: [drive, load], time_constant: 0.2, ",
                             "TractionCurve, shafts: [drive, load], inertia: 2, nominal_torque: "
                             "60, nominal_slip: 0.5, load_square: 0.02, "}) {
    SCOPED_TRACE(plugin);
    const auto jumped = accelerationAfterRatioStep("hold: zero_order", 0.0, plugin);
    double previous = 0.0;
    for (const double h : {1e-3, 1e-4}) {
      const auto ramped = accelerationAfterRatioStep(
          "hold: rate_limit, rate: " + std::to_string(0.3 / h), h, plugin);
      const double gap = std::hypot(ramped[0] - jumped[0], ramped[1] - jumped[1]);
      EXPECT_LT(gap, 1e3 * h);
      if (previous > 0.0) {
        EXPECT_NEAR(gap / previous, 0.1, 0.02) << "first order in h";
      }
      previous = gap;
    }
    const auto before = accelerationAfterRatioStep("hold: rate_limit, rate: 1e-9", 0.0, plugin);
    EXPECT_GT(std::abs(jumped[1] - before[1]), 0.1) << "nothing jumped";
  }
}

TEST(Plugins, PowerFlowKeepsTheEnergyAccount) {
  for (const double e1 : {-2.0, 2.0}) {  // from drive to load, and back
    const double e2 = e1 < 0.0 ? -0.8 * 0.8 * 5.0 * e1 / 6.0 : -0.8 * 5.0 * e1 / 0.8 / 6.0;
    Simulation flow(sceneOf(
        "PowerFlow, shafts: [drive, load], inertias: [0.8, 2], efficiency: 0.8, smoothing_power: "
        "1e-6",
        "initial: {project: true, velocity: [5, 3], acceleration: [" + std::to_string(e1) + ", " +
            std::to_string(e2) + "]}\n"));
    const Sample before = flow.sample();
    ASSERT_TRUE(flow.advanceTo(0.01).ok()) << flow.describeStatus();
    const Sample& after = flow.sample();
    const auto gained = [&](int i, double J) {
      return 0.5 * J *
             (after.velocity[i] * after.velocity[i] - before.velocity[i] * before.velocity[i]);
    };
    const double drive = gained(0, 0.8);
    const double load = gained(1, 2.0);
    EXPECT_GT(drive * e1, 0.0) << "the power flows the wrong way";
    EXPECT_NEAR(drive < 0.0 ? load / -drive : drive / -load, 0.8, 1e-5);
  }
}

// ------------------------------------------------------------------------------------------- keys

TEST(Plugins, RefuseFaultsByPath) {
  test::expectFaultsOfElements("constraint_laws", [](const std::string& text) { sceneOf(text); });
}

// ---------------------------------------------------------------------------------- documentation

TEST(Documentation, ExamplesAreReadRunAndEveryKeyIsThere) {
  std::set<std::string> types{"variator_sim/ExpressionConstraint"};
  BuiltinComponentFactory factory;
  for (const std::string& example : test::readExamples("Constraints")) {
    SCOPED_TRACE(example);
    const ParameterTree parsed = readYamlText(example, "doc/scene.md");
    const auto& [name, dictionary] = *parsed.asDictionary().begin();
    const std::string text =
        "shafts: [drive, load]\ndrive: {inertia: 0.8}\nload: {inertia: 2}\n"
        "initial: {velocity: [5, 3], project: true}\n"
        "torques: [motor]\nmotor: {type: variator_sim/ExpressionTorque, "
        "shaft: drive, torque: \"5-0.1*w1\"}\nconstraints: [" +
        name + "]\n" + example;
    ParameterTree tree = readYamlText(text, "doc/scene.md");
    Simulation simulation(readScene(tree, factory));
    EXPECT_TRUE(simulation.advanceTo(0.5).ok()) << simulation.describeStatus();

    ParameterTree& element = tree.asDictionary().at(name);
    const std::string type = element.asDictionary().at("type").asText();
    types.insert(type);
    std::set<std::string> allowed = test::allowedKeys(tree, element);
    allowed.erase("type");
    const std::set<std::string> documented = test::documentedKeys(type.substr(type.find('/') + 1));
    for (const std::string& key : allowed) EXPECT_EQ(documented.count(key), 1U) << key;
  }
  const std::vector<std::string> all = factory.constraintTypes();
  EXPECT_EQ(types, std::set<std::string>(all.begin(), all.end()));
}

// ----------------------------------------------------------------------------- verify_derivatives

/// f = omega_b - u omega_a, as a function template that is also read by Expressions.
class FirstOrderWithInput : public Constraint {
 public:
  template <class T>
  static T calcResidual(const T& u, const T& w_a, const T& w_b) {
    return w_b - u * w_a;
  }

 private:
  void build(LawContext& scene) override {
    const Expression u = scene.command();
    scene.constrain(calcResidual(u, scene.shaftAt(0).velocity, scene.shaftAt(1).velocity));
  }
};

class Factory : public BuiltinComponentFactory {
  ConstraintPtr createConstraint(const std::string& type) override {
    if (type == "test/First") return std::make_shared<FirstOrderWithInput>();
    return BuiltinComponentFactory::createConstraint(type);
  }
};

std::string messageOf(const std::string& yaml) {
  Factory factory;
  return test::messageOf([&] { readScene(readYamlText(yaml, "test"), factory); });
}

TEST(VerifyDerivatives, IsABoolean) {
  EXPECT_NE(
      messageOf("shafts: [a]\na: {inertia: 1}\nverify_derivatives: 3\n").find("verify_derivatives"),
      std::string::npos);
}

// Derivatives that differences cannot resolve are not checked: such formulas are loaded.
TEST(VerifyDerivatives, AsksNothingOfFormulas) {
  for (const char* law :
       {"-6919.2*cos(1e15*t)", "-6919.2*cos(9e18*t)*sin(phi1+1e300)", "tanh(w1/1e-300)*5e-324",
        "map(w1, 0.5)", "sqrt(w1-12.4+1e-300)+(w1-12.4)^0.5"}) {
    EXPECT_EQ(messageOf(test::sceneText("a 1", {std::string("it on a: ") + law}, R"yaml(
initial: {velocity: [12.4]}
tables: [map]
map: {x: [0, 100], y: [-1.0e+10, 0.5, 1], values: [[0, 1, 2], [3, 4, 6]]}
)yaml")),
              "")
        << law;
  }
}

TEST(VerifyDerivatives, AnInputOfOrder1NeedsTwoDerivativesInEveryPlugin) {
  const std::string scene =
      "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\nconstraints: [it]\nit: {type: "
      "test/First, topic: u, ";
  EXPECT_NE(
      messageOf(scene + "hold: first_order_lag, time_constant: 1}\n").find("second_order_lag"),
      std::string::npos);
  EXPECT_EQ(messageOf(scene + "hold: second_order_lag, time_constant: 1}\n"), "");
}

}  // namespace
}  // namespace variator_sim
