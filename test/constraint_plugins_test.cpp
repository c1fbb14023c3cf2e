// The ready-made constraints against the same formulas typed into a scene, in rows and in motion;
// jumps of a commanded ratio against fast ramps; derivatives of the rows by the state and what they
// depend on; faults of their keys; that the documentation's examples are read; and that a wrong
// derivative or statement is caught at load, a right one with kinks not.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "model/derivative_check.h"
#include "support/count_allocations.h"
#include "support/derivatives_by_state.h"
#include "support/documents.h"
#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/formula_constraint.h"
#include "variator_sim/table.h"

namespace variator_sim {
namespace {

/// Two shafts, a motor, a propeller, one constraint `it`.
std::string sceneText(const std::string& constraint, const std::string& rest = "") {
  return "shafts: [drive, load]\ndrive: {inertia: 0.8}\nload: {inertia: 2}\n"
         "torques: [motor, propeller, command]\n"
         "motor: {type: variator_sim/ExpressionTorque, shaft: drive, torque: "
         "\"12*((50-w1)/50)/(((50-w1)/50)^2+0.04)\"}\n"
         "propeller: {type: variator_sim/ExpressionTorque, shaft: load, torque: \"-0.02*w2^2\"}\n"
         "command: {type: variator_sim/CommandedTorque, shaft: drive, topic: torque}\n"
         "constraints: [it]\nit: {type: variator_sim/" +
         constraint + "}\n" + rest;
}

Scene sceneOf(const std::string& constraint, const std::string& rest = "") {
  return test::withTolerance(test::sceneFromText(sceneText(constraint, rest)), 1e-11);
}

struct Twin {
  const char* plugin;
  const char* formula;
};

const Twin kTwins[] = {
    {"KinematicRatio, shafts: [drive, load], ratio: 0.6", "order: 1, expression: \"w2-0.6*w1\""},
    {"KinematicRatio, shafts: [load, drive], ratio: 0.6", "order: 1, expression: \"w1-0.6*w2\""},
    {"KinematicRatio, shafts: [drive, load], ratio: \"2*3/10\"",
     "order: 1, expression: \"w2-0.6*w1\""},
    {"VBeltRatio, shafts: [drive, load], ratio_low: 0.4, ratio_high: 1.3, speed: 4, width: 0.7, "
     "load: 3, load_torque: 11",
     "order: 1, expression: \"w2-(0.4+0.45*(1+tanh(((w1/4)^2-1-3/11)/0.7)))*w1\""},
    {"SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6",
     "order: 2, expression: \"0.2*(e2-0.6*e1)+w2-0.6*w1\""},
    {"SlipRatio, shafts: [load, drive], time_constant: 0.2, ratio: 0.6",
     "order: 2, expression: \"0.2*(e1-0.6*e2)+w1-0.6*w2\""},
    {"AccelerationMagnitude, shafts: [drive, load], magnitude: 2",
     "order: 2, expression: \"e1^2+e2^2-4\""},
    {"PowerFlow, shafts: [drive, load], inertias: [0.8, 2], power: 30",
     "order: 2, expression: \"0.8*w1*e1+2*w2*e2-30\""},
    {"PowerFlow, shafts: [drive, load], inertias: [0.8, 2], efficiency: 0.8, smoothing_power: 3",
     "order: 2, expression: \"2*w2*e2+(1.25+0.8)/2*0.8*w1*e1+(1.25-0.8)/2*(sqrt((0.8*w1*e1)^2+9)-"
     "3)\""},
    {"TractionCurve, shafts: [drive, load], ratio: 0.6, inertia: 2, nominal_torque: 20, "
     "nominal_slip: 0.05, sharpness: 1.5, load: 1, load_square: 0.02",
     "order: 2, expression: "
     "\"w2-0.6*w1*(1-0.05/sinh(1.5)*sinh((2*e2+1+0.02*w2^3/sqrt(w2^2+0.01))*1.5/20))\""},
    {"ImposedJerk, shaft: load, jerk: 1.5", "order: 3, expression: \"j2-1.5\""},
    {"JerkLimit, shaft: load, limit: 4, time_constant: 0.3, acceleration: 2",
     "order: 3, expression: \"j2-4*tanh((2-e2)/1.2)\""},
};

TEST(Plugins, HaveTheRowsOfTheirFormulas) {
  for (const Twin& twin : kTwins) {
    SCOPED_TRACE(twin.plugin);
    const Scene a = sceneOf(twin.plugin);
    const Scene b = sceneOf(std::string("ExpressionConstraint, ") + twin.formula);
    const Constraint& plugin = *a.constraints[0];
    const Constraint& formula = *b.constraints[0];
    ASSERT_EQ(plugin.order(), formula.order());
    EXPECT_EQ(plugin.isLinearInAcceleration(), formula.isLinearInAcceleration());
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
      double dC[2][12];
      double dc0[2][6];
      plugin.calcRowDerivatives(x, dC[0], dc0[0]);
      formula.calcRowDerivatives(x, dC[1], dc0[1]);
      for (int i = 0; i < 12; ++i) {
        EXPECT_NEAR(dC[0][i], dC[1][i], 1e-12 * std::max(1.0, std::abs(dC[1][i]))) << i;
      }
      for (int i = 0; i < 6; ++i) {
        EXPECT_NEAR(dc0[0][i], dc0[1][i], 1e-12 * std::max(1.0, std::abs(dc0[1][i]))) << i;
      }
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
    ConstraintPartials partials;
    const long before = allocations;
    plugin.calcRow(x, C, &c0);
    plugin.calcResidual(x);
    if (plugin.order() < 3) plugin.calcResidualAndJacobian(x, C);
    if (plugin.order() == 1) plugin.calcVelocityResidualAndJacobian(x, C);
    plugin.calcPartials(x, partials);
    plugin.calcInputJacobian(x, 1, &c0);
    plugin.calcJacobianRate(x, C, H);
    plugin.calcHessian(x, H);
    double dC[12];
    double dc0[6];
    plugin.calcRowDerivatives(x, dC, dc0);
    EXPECT_EQ(allocations, before);
  }
}
#endif

/// A ready-made constraint in one of its forms, and what it states.
struct Statement {
  const char* plugin;
  bool time;
  bool constant_C;
};

const char* const kImposed = "ImposedJerk, shaft: load, velocity_change: 20, duration: 4, start: 0";

const Statement kStatements[] = {
    {"KinematicRatio, shafts: [load, drive], ratio: 0.6", false, true},
    {"KinematicRatio, shafts: [drive, load], ratio: {times: [-1, 2, 5], values: [0.4, 0.8, 0.6]}",
     true, false},
    {"KinematicRatio, shafts: [drive, load], ratio: {topic: u, hold: second_order_lag, "
     "time_constant: 0.3}",
     false, false},
    {"VBeltRatio, shafts: [drive, load], ratio_low: 0.4, ratio_high: 1.3, speed: 4, width: 0.7",
     false, false},
    {"VBeltRatio, shafts: [load, drive], ratio_low: 0.4, ratio_high: 1.3, speed: 4, width: 0.7, "
     "load: {times: [-1, 2, 5], values: [4, 8, 6]}, load_torque: 11",
     true, false},
    {"VBeltRatio, shafts: [drive, load], ratio_low: 0.4, ratio_high: 1.3, speed: 4, width: 0.7, "
     "load: {topic: u, hold: second_order_lag, time_constant: 0.3}, load_torque: 11",
     false, false},
    {"SlipRatio, shafts: [load, drive], time_constant: 0.2, ratio: 0.6", false, true},
    {"SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: {times: [-1, 2, 5], values: "
     "[0.4, 0.8, 0.6]}",
     true, false},
    {"SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: {topic: u}", false, false},
    {"AccelerationMagnitude, shafts: [drive, load], magnitude: 2", false, false},
    {"PowerFlow, shafts: [drive, load], inertias: [0.8, 2], power: 30", false, false},
    {"PowerFlow, shafts: [drive, load], inertias: [0.8, 2], power: {times: [-1, 2, 5], values: "
     "[4, 8, 6]}",
     true, false},
    {"PowerFlow, shafts: [drive, load], inertias: [0.8, 2], power: {topic: u}", false, false},
    {"PowerFlow, shafts: [drive, load], inertias: [0.8, 2], efficiency: 0.8, smoothing_power: 3",
     false, false},
    {"TractionCurve, shafts: [load, drive], ratio: 0.6, inertia: 2, nominal_torque: 20, "
     "nominal_slip: 0.05, sharpness: 1.5, load: 1, load_square: 0.02, regularization_speed: 2",
     false, false},
    {"TractionCurve, shafts: [drive, load], ratio: {topic: u}, inertia: 2, nominal_torque: 20, "
     "nominal_slip: 0.05, load: {times: [-1, 2, 5], values: [4, 8, 6]}",
     true, false},
    {"TractionCurve, shafts: [drive, load], ratio: {times: [-1, 2, 5], values: [0.4, 0.8, 0.6]}, "
     "inertia: 2, nominal_torque: 20, nominal_slip: 0.05, load: {topic: u}",
     true, false},
    {"ImposedJerk, shaft: load, jerk: 1.5", false, true},
    {"ImposedJerk, shaft: drive, jerk: {topic: u}", false, true},
    {"ImposedJerk, shaft: load, jerk: {times: [-1, 2, 5], values: [0, 5, 0]}", true, true},
    {kImposed, true, true},
    {"JerkLimit, shaft: load, limit: 4, time_constant: 0.3, acceleration: 2", false, true},
    {"JerkLimit, shaft: drive, limit: 4, time_constant: 0.3, acceleration: {topic: u}", false,
     true},
    {"JerkLimit, shaft: load, limit: 4, time_constant: 0.3, acceleration: {times: [-1, 2, 5], "
     "values: [0, 5, 0]}",
     true, true},
};

TEST(Plugins, HaveTheDerivativesOfTheirRowsAndDependOnWhatTheyState) {
  std::set<std::string> types{"variator_sim/ExpressionConstraint"};
  for (const Statement& statement : kStatements) {
    SCOPED_TRACE(statement.plugin);
    const std::string plugin = statement.plugin;
    types.insert("variator_sim/" + plugin.substr(0, plugin.find(',')));
    const Scene scene = sceneOf(plugin);
    const Constraint& it = *scene.constraints[0];
    EXPECT_EQ(it.dependence().time, statement.time);
    EXPECT_FALSE(it.dependence().angle);
    EXPECT_EQ(it.hasConstantJacobian(), statement.constant_C);
    for (int n = 0; n < 5; ++n) {
      const double angle[] = {0.2 * n, 1.0 - n};
      const double velocity[] = {4.0 + 0.7 * n, 3.1 - 0.9 * n};
      const double acceleration[] = {1.3 - n, 0.4 + 0.8 * n};
      const double input[] = {0.0, 0.7};
      const double rate[] = {0.0, 0.3 - n};
      const double second[] = {0.0, 1.1};
      const StateView x{0.2 + 0.3 * n, angle, velocity, acceleration, input, rate, second};
      test::expectRowDerivatives(it, x);
    }
  }
  const std::vector<std::string> all = BuiltinComponentFactory().constraintTypes();
  EXPECT_EQ(types, std::set<std::string>(all.begin(), all.end()));
}

TEST(Plugins, MoveAsTheirFormulas) {
  for (const Twin& twin : kTwins) {
    for (const char* principle : {"generalized_gauss", "gauss"}) {
      SCOPED_TRACE(std::string(twin.plugin) + ' ' + principle);
      const std::string rest =
          std::string("principle: ") + principle + "\ninitial: {velocity: [5, 3], project: true}\n";
      Simulation plugin(sceneOf(twin.plugin, rest));
      Simulation formula(sceneOf(std::string("ExpressionConstraint, ") + twin.formula, rest));
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
      Table::read(reader, {"x", Range::any()}, {"y", Range::any()}, Table::Beyond::kConstant);
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
    double dC[12];
    double dc0[6];
    table.constraints[0]->calcRowDerivatives(x, dC, dc0);
    EXPECT_NEAR(dc0[2], -curve.curvature(t), 1e-15) << "by omega_a";
    EXPECT_NEAR(dc0[4], -2.0 * curve.slope(t), 1e-15) << "by epsilon_a";
    commanded.constraints[0]->calcRow(x, C, &c0);
    EXPECT_NEAR(C[0], -input[1], 1e-14);
    EXPECT_NEAR(c0, -(2.0 * 0.2 * 1.3 + -0.9 * 4.0), 1e-12);
    double Cu[2] = {7.0, 7.0};
    commanded.constraints[0]->calcInputJacobian(x, 2, Cu);
    EXPECT_EQ(Cu[0], 0.0);
    EXPECT_NEAR(Cu[1], -4.0, 1e-14);
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

double kineticEnergy(const Sample& s) {
  return 0.5 * (0.8 * s.velocity[0] * s.velocity[0] + 2.0 * s.velocity[1] * s.velocity[1]);
}

TEST(Plugins, PowerFlowKeepsTheEnergyAccount) {
  Simulation imposed(
      sceneOf("PowerFlow, shafts: [drive, load], inertias: [0.8, 2], power: "
              "{topic: power, initial: 30}",
              "initial: {velocity: [5, 3]}\n"));
  const double start = kineticEnergy(imposed.sample());
  ASSERT_TRUE(imposed.advanceTo(1.0).ok());
  EXPECT_NEAR(kineticEnergy(imposed.sample()), start + 30.0, 1e-8);
  imposed.command(inputOf(imposed, "power"), -10.0);
  ASSERT_TRUE(imposed.advanceTo(2.0).ok()) << imposed.describeStatus();
  EXPECT_NEAR(kineticEnergy(imposed.sample()), start + 20.0, 1e-8);

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

TEST(Plugins, AStartByImposedJerkEndsAtItsSpeed) {
  Simulation simulation(
      sceneOf("ImposedJerk, shaft: load, velocity_change: 20, duration: 4, start: 0.5",
              "initial: {velocity: [5, 3], acceleration: [1, 0]}\n"));
  ASSERT_TRUE(simulation.advanceTo(0.5).ok());
  EXPECT_NEAR(simulation.sample().velocity[1], 3.0, 1e-10);
  ASSERT_TRUE(simulation.advanceTo(2.5).ok());
  EXPECT_NEAR(simulation.sample().velocity[1], 13.0, 1e-7);
  EXPECT_NEAR(simulation.sample().acceleration[1], 10.0, 1e-7);
  ASSERT_TRUE(simulation.advanceTo(6.0).ok());
  EXPECT_NEAR(simulation.sample().velocity[1], 23.0, 1e-7);
  EXPECT_NEAR(simulation.sample().acceleration[1], 0.0, 1e-7);
}

TEST(Plugins, AJerkLimitFollowsAStepOfItsTarget) {
  Simulation simulation(
      sceneOf("JerkLimit, shaft: load, limit: 10, time_constant: 0.05, acceleration: {topic: "
              "target, initial: 0}",
              "initial: {velocity: [5, 3], acceleration: [1, 0]}\n"));
  simulation.advanceTo(0.1);
  simulation.command(inputOf(simulation, "target"), 5.0);
  EXPECT_NEAR(simulation.sample().acceleration[1], 0.0, 1e-12) << "the acceleration jumped";
  simulation.advanceTo(0.3);
  EXPECT_NEAR(simulation.sample().acceleration[1], 2.0, 1e-3);
  simulation.advanceTo(2.0);
  EXPECT_NEAR(simulation.sample().acceleration[1], 5.0, 1e-6);
}

// ------------------------------------------------------------------------------------------- keys

/// How constraints begin, and what is wrong behind.
const std::pair<std::string, const char*> kFaults[] = {
    {"", R"(
KinematicRatio, shafts: [drive, load] => it/ratio: missing
KinematicRatio, shafts: [drive, lod], ratio: 1 => it/shafts[1]: load
SlipRatio, shafts: [drive, load], time_constant: 0, ratio: 1 => it/time_constant: > 0
SlipRatio, shafts: [drive, load], time_constnt: 1, ratio: 1 => it/time_constant: time_constnt
TractionCurve, shafts: [drive, load], ratio: 1, inertia: 1, nominal_torque: 1, nominal_slip: 1
  => it/nominal_slip: 1
AccelerationMagnitude, shafts: [drive, load], magnitude: -1 => it/magnitude: > 0
ImposedJerk, shaft: load, jerk: 1, velocity_change: 2, duration: 1 => it/jerk: one of them
ImposedJerk, shaft: load, jerk: 1, start: 2 => it/start: velocity_change
JerkLimit, shaft: load, limit: 1, time_constant: 1 => it/acceleration: missing
)"},
    {"KinematicRatio, shafts: [drive, load], ", R"(
ratio: {topic: r, hold: zero_order} => it/ratio/hold: variator_sim/SlipRatio
ratio: {topic: r, hold: zero_order, time_constant: 1}
  => it/ratio/time_constant: 'first_order_lag' or 'second_order_lag'
ratio: {topic: r} => it/ratio/hold: order 1
ratio: {topic: r, hold: second_order_lag} => it/ratio/time_constant: missing
ratio: {topic: r, hold: second_order_lag, time_constant: 1, rate: 2} => it/ratio/rate: rate_limit
ratio: {topic: torque, hold: second_order_lag, time_constant: 1} => it/ratio/topic: used twice
ratio: [1, 2] => it/ratio: expected a number
ratio: {times: [1, 0], values: [1, 1]} => it/ratio/times[1]: increas
)"},
    {"VBeltRatio, shafts: [drive, load], ", R"(
ratio_low: "1-2", ratio_high: 1, speed: 3 => it/ratio_low: '1-2' is -1.0; allowed: a number > 0
ratio_low: 1, ratio_high: 1, speed: 3 => it/ratio_high: > 1
ratio_low: 1, ratio_high: 2, speed: 3, load_torque: 1 => it/load_torque: 'load'
ratio_low: 1, ratio_high: 2, speed: 3, load: {topic: l, hold: rate_limit, rate: 1}, load_torque: 1
  => it/load/hold: second_order_lag
)"},
    {"PowerFlow, shafts: [drive, load], inertias: [1, 2], ", R"(
power: 1, efficiency: 0.5 => it/power: one of them
power: 1, smoothing_power: 0.5 => it/smoothing_power: efficiency
efficiency: 1.5 => it/efficiency: 1
)"},
};

TEST(Plugins, RefuseFaultsByPath) {
  for (const auto& [constraint, table] : kFaults) {
    test::expectFaults(test::readFaults(constraint, table),
                       [](const std::string& text) { sceneOf(text); });
  }
}

// ---------------------------------------------------------------------------------- documentation

TEST(Documentation, ExamplesAreReadRunAndEveryKeyIsThere) {
  std::set<std::string> types{"variator_sim/ExpressionConstraint"};
  BuiltinComponentFactory factory;
  for (const std::string& example : test::readExamples("constraints.md")) {
    SCOPED_TRACE(example);
    const ParameterTree parsed = readYamlText(example, "doc/constraints.md");
    const auto& [name, dictionary] = *parsed.asDictionary().begin();
    const std::string text =
        "shafts: [drive, load]\ndrive: {inertia: 0.8}\nload: {inertia: 2}\n"
        "initial: {velocity: [5, 3], project: true}\n"
        "torques: [motor]\nmotor: {type: variator_sim/ExpressionTorque, "
        "shaft: drive, torque: \"5-0.1*w1\"}\nconstraints: [" +
        name + "]\n" + example;
    ParameterTree tree = readYamlText(text, "doc/constraints.md");
    Simulation simulation(readScene(tree, factory));
    EXPECT_TRUE(simulation.advanceTo(0.5).ok()) << simulation.describeStatus();

    ParameterTree& element = tree.asDictionary().at(name);
    const std::string type = element.asDictionary().at("type").asText();
    types.insert(type);
    std::set<std::string> allowed = test::allowedKeys(tree, element);
    allowed.erase("type");
    const std::set<std::string> documented =
        test::documentedKeys("constraints.md", type.substr(type.find('/') + 1));
    for (const std::string& key : allowed) EXPECT_EQ(documented.count(key), 1U) << key;
  }
  const std::vector<std::string> all = factory.constraintTypes();
  EXPECT_EQ(types, std::set<std::string>(all.begin(), all.end()));
}

// ----------------------------------------------------------------------------- verify_derivatives

enum class Seed {
  kNothing,
  kPartial,
  kPartialOfTime,
  kInput,
  kRow,
  kRowC,
  kResidual,
  kLinear,
  kHessian,
  kRate,
  kRowByState,
  kRateOfRowByState,
  kUnwritten,
  kNoTime,
  kNoAngle,
  kConstant
};

/// psi = 0.2 e2 (1 + e1^2) - 0.6 w1 sin(t) + w2 + 2 u + sin(phi2), with one seeded fault.
class Faulty : public Constraint {
 public:
  explicit Faulty(Seed seed) : seed_(seed) {}

 protected:
  void doConfigure(ComponentContext& context) override {
    CommandInputSettings input;
    input.owner = context.name();
    input.topic = "u";
    input_ = context.addInput(input);
  }
  bool doReadsInputs() const override { return true; }
  bool doIsLinearInAcceleration() const override { return seed_ == Seed::kLinear; }
  double doCalcResidual(const StateView& x) const override {
    const double* e = x.acceleration;
    return 0.2 * e[1] * (1 + e[0] * e[0]) - 0.6 * x.velocity[0] * std::sin(x.time) + x.velocity[1] +
           2 * x.input[input_] + std::sin(x.angle[1]);
  }
  void doCalcPartials(const StateView& x, ConstraintPartials& p) const override {
    const double* e = x.acceleration;
    p.time = -0.6 * x.velocity[0] * std::cos(x.time) * (seed_ == Seed::kPartialOfTime ? -1 : 1);
    p.angle[1] = std::cos(x.angle[1]);
    p.velocity[0] = -0.6 * std::sin(x.time);
    p.velocity[1] = 1;
    p.acceleration[0] = 0.4 * e[1] * e[0];
    p.acceleration[1] = 0.2 * (1 + e[0] * e[0]) * (seed_ == Seed::kPartial ? 1.001 : 1);
    p.input[input_] = seed_ == Seed::kInput ? 0 : 2;
  }
  void doCalcRow(const StateView& x, double* C, double* c0) const override {
    Constraint::doCalcRow(x, C, c0);
    if (seed_ == Seed::kRow) *c0 += 0.1;
    if (seed_ == Seed::kRowC) C[1] *= 1.001;
  }
  double doCalcResidualAndJacobian(const StateView& x, double* C) const override {
    return Constraint::doCalcResidualAndJacobian(x, C) + (seed_ == Seed::kResidual ? 1e-3 : 0);
  }
  void doCalcHessian(const StateView& x, double* H) const override {
    Constraint::doCalcHessian(x, H);
    if (seed_ == Seed::kHessian) H[3] = 1.0;
  }
  void doCalcJacobianRate(const StateView& x, double* D, double* H) const override {
    Constraint::doCalcJacobianRate(x, D, H);
    if (seed_ == Seed::kRate) D[0] += 1.0;
  }
  void doCalcRowDerivatives(const StateView& x, double* dC, double* dc0) const override {
    const double unwritten = dC[0];
    Constraint::doCalcRowDerivatives(x, dC, dc0);
    if (seed_ == Seed::kUnwritten) dC[0] = unwritten;
    if (seed_ == Seed::kRowByState) dC[5 * 2 + 0] *= 1.001;  // dC1/de2 = 0.4 e1
    if (seed_ == Seed::kRateOfRowByState) dc0[3] += 1e-3;    // dc0/dw2 = cos(phi2)
  }
  Dependence doDependence() const override {
    return {seed_ != Seed::kNoTime, seed_ != Seed::kNoAngle};
  }
  bool doHasConstantJacobian() const override { return seed_ == Seed::kConstant; }

 private:
  Seed seed_;
  int input_ = 0;
};

/// Q2 = -0.02 w2^2 - 3 sin(phi2) + cos(t), with one seeded fault.
class FaultyTorque : public Torque {
 public:
  enum class Fault { kNothing, kRate, kRateByState, kTime, kAngle, kRateTime, kRateAngle, kShafts };
  explicit FaultyTorque(Fault fault) : fault_(fault) {}

 protected:
  void doConfigure(ComponentContext& /*context*/) override {}
  void doAddTorque(const StateView& x, double* torque) const override {
    torque[1] +=
        -0.02 * x.velocity[1] * x.velocity[1] - 3 * std::sin(x.angle[1]) + std::cos(x.time);
  }
  void doAddTorqueRate(const StateView& x, double* rate) const override {
    if (fault_ == Fault::kRate) return;  // forgotten
    rate[1] += -0.04 * x.velocity[1] * x.acceleration[1] -
               3 * std::cos(x.angle[1]) * x.velocity[1] - std::sin(x.time);
  }
  void doAddTorqueRateDerivatives(const StateView& x, double* derivatives) const override {
    const double w = x.velocity[1];
    derivatives[1 * 2 + 1] += 3 * std::sin(x.angle[1]) * w;
    derivatives[3 * 2 + 1] -= 0.04 * x.acceleration[1] + 3 * std::cos(x.angle[1]);
    derivatives[5 * 2 + 1] -= 0.04 * w * (fault_ == Fault::kRateByState ? 1.001 : 1);
  }
  Dependence doTorqueDependence() const override {
    return {fault_ != Fault::kTime, fault_ != Fault::kAngle};
  }
  Dependence doRateDependence() const override {
    return {fault_ != Fault::kRateTime, fault_ != Fault::kRateAngle};
  }
  std::vector<int> doShafts() const override { return {fault_ == Fault::kShafts ? 0 : 1}; }

 private:
  Fault fault_;
};

/// f = omega_b - u omega_a, as a function template that is also read by Expressions.
class FirstOrderWithInput : public FormulaConstraint {
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

class SeededFactory : public BuiltinComponentFactory {
 public:
  explicit SeededFactory(Seed seed) : seed_(seed) {}
  explicit SeededFactory(FaultyTorque::Fault fault) : fault_(fault) {}
  ConstraintPtr createConstraint(const std::string& type) override {
    if (type == "test/Faulty") return std::make_shared<Faulty>(seed_);
    if (type == "test/First") return std::make_shared<FirstOrderWithInput>();
    return BuiltinComponentFactory::createConstraint(type);
  }
  TorquePtr createTorque(const std::string& type) override {
    if (type == "test/Faulty") return std::make_shared<FaultyTorque>(fault_);
    return BuiltinComponentFactory::createTorque(type);
  }

 private:
  Seed seed_ = Seed::kNothing;
  FaultyTorque::Fault fault_ = FaultyTorque::Fault::kNothing;
};

const char* const kSeeded =
    "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\nconstraints: [it]\nit: {type: "
    "test/Faulty}\ninitial: {velocity: [5, 3]}\n";

template <class Seeded>
std::string messageOf(const std::string& yaml, Seeded fault) {
  SeededFactory factory(fault);
  try {
    const ParameterTree tree = readYamlText(yaml, "test");
    const Scene scene = readScene(tree, factory);
    // Nobody states the derivatives of formulas; that they are right is asked here.
    const auto verify = tree.asDictionary().find("verify_derivatives");
    if (verify == tree.asDictionary().end()) verifyDerivatives(scene, Compared::kAll);
  } catch (const SceneError& error) {
    return error.what();
  }
  return "";
}

TEST(VerifyDerivatives, CatchesASeededFaultAndNamesIt) {
  EXPECT_EQ(messageOf(kSeeded, Seed::kNothing), "");
  const std::pair<Seed, const char*> seeds[] = {
      {Seed::kPartial, "d psi/d e2 of"},
      {Seed::kPartialOfTime, "d psi/d t of"},
      {Seed::kInput, "d psi/d the input 'u' of"},
      {Seed::kRow, "c0 of"},
      {Seed::kRowC, "C2 of calcRow of"},
      {Seed::kResidual, "psi of calcResidualAndJacobian of"},
      {Seed::kLinear, "d C1/d e1 (isLinearInAcceleration) of"},
      {Seed::kHessian, "d C2/d e2 of"},
      {Seed::kRate, "d C1/dt (calcJacobianRate) of"},
      {Seed::kRowByState, "d C1/d e2 (calcRowDerivatives) of"},
      {Seed::kRateOfRowByState, "d c0/d w2 (calcRowDerivatives) of"},
      {Seed::kUnwritten, "d C1/d phi1 (calcRowDerivatives) of constraint 'it' is not written"},
      {Seed::kNoTime,
       "of constraint 'it' is stated not to depend on the time (dependence), but it is"},
      {Seed::kNoAngle,
       "of constraint 'it' is stated not to depend on the angles (dependence), but it is"},
      {Seed::kConstant,
       "C1 of constraint 'it' is stated to be constant (hasConstantJacobian), but it is"},
  };
  for (const auto& [seed, words] : seeds) {
    const std::string message = messageOf(kSeeded, seed);
    EXPECT_NE(message.find(words), std::string::npos) << words << " not in: " << message;
    EXPECT_NE(message.find("constraint 'it'"), std::string::npos) << message;
    EXPECT_NE(message.find("acceleration = ["), std::string::npos) << message;
    EXPECT_EQ(messageOf(std::string(kSeeded) + "verify_derivatives: false\n", seed), "");
  }
}

TEST(VerifyDerivatives, CatchesAFaultOfATorque) {
  const std::string scene =
      "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\ntorques: [it]\nit: {type: test/Faulty}\n"
      "initial: {velocity: [5, 3], acceleration: [1, 1]}\n";
  EXPECT_EQ(messageOf(scene, FaultyTorque::Fault::kNothing), "");
  const std::pair<FaultyTorque::Fault, const char*> faults[] = {
      {FaultyTorque::Fault::kRate, "dQ/dt of shaft 'b' of torque 'it' is stated as 0"},
      {FaultyTorque::Fault::kRateByState,
       "d Q'/d e2 of shaft 'b' (addTorqueRateDerivatives) of torque 'it' is stated as -0.12"},
      {FaultyTorque::Fault::kTime,
       "Q of shaft 'b' of torque 'it' is stated not to depend on the time (torqueDependence), but "
       "it is"},
      {FaultyTorque::Fault::kAngle,
       "Q of shaft 'b' of torque 'it' is stated not to depend on the angles"},
      {FaultyTorque::Fault::kRateTime,
       "dQ/dt of shaft 'b' of torque 'it' is stated not to depend on the time (rateDependence)"},
      {FaultyTorque::Fault::kRateAngle,
       "dQ/dt of shaft 'b' of torque 'it' is stated not to depend on the angles"},
      {FaultyTorque::Fault::kShafts,
       "Q of shaft 'b' of torque 'it' is stated to be 0 (shafts), but it is"},
  };
  for (const auto& [fault, words] : faults) {
    const std::string message = messageOf(scene, fault);
    EXPECT_NE(message.find(words), std::string::npos) << words << " not in: " << message;
    EXPECT_EQ(messageOf(scene + "verify_derivatives: false\n", fault), "");
  }
}

/// psi = e2 - e1 + sin(1e5 w1): differences of one step miss its second derivative everywhere.
class Wavy : public Constraint {
 protected:
  void doConfigure(ComponentContext& /*context*/) override {}
  double doCalcResidual(const StateView& x) const override {
    return x.acceleration[1] - x.acceleration[0] + std::sin(1e5 * x.velocity[0]);
  }
  void doCalcPartials(const StateView& x, ConstraintPartials& p) const override {
    p.velocity[0] = 1e5 * std::cos(1e5 * x.velocity[0]);
    p.acceleration[0] = -1.0;
    p.acceleration[1] = 1.0;
  }
};

/// The same that states what the default gives, but for rounding.
class WavyStatement : public Wavy {
 protected:
  void doCalcRowDerivatives(const StateView& x, double* dC, double* dc0) const override {
    Constraint::doCalcRowDerivatives(x, dC, dc0);
    dc0[2] *= 1.0 + 1e-14;  // by w1
  }
};

TEST(VerifyDerivatives, LeavesTheDefaultDifferencesAlone) {
  class Factory : public BuiltinComponentFactory {
   public:
    ConstraintPtr createConstraint(const std::string& type) override {
      if (type == "test/Wavy") return std::make_shared<Wavy>();
      return std::make_shared<WavyStatement>();
    }
  };
  const auto load = [](const std::string& type) {
    Factory factory;
    readScene(readYamlText("shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\nconstraints: "
                           "[it]\nit: {type: test/" +
                               type +
                               "}\ninitial: {velocity: [5, 3], acceleration: [1, 1], project: "
                               "true}\n",
                           "test"),
              factory);
  };
  EXPECT_NO_THROW(load("Wavy"));
  EXPECT_THROW(load("WavyStatement"), SceneError);
}

TEST(VerifyDerivatives, IsABoolean) {
  EXPECT_NE(messageOf(std::string(kSeeded) + "verify_derivatives: 3\n", Seed::kNothing)
                .find("verify_derivatives"),
            std::string::npos);
}

TEST(VerifyDerivatives, DoesNotCryAtKinksSteepsAndPoles) {
  const char* const torques[] = {
      "abs(w1)*w1-abs(w2)",
      "max(w1, 0)+min(w2, w1)+sign(w1)",
      "sign(w1-5)*w1",
      "100*tanh(w1/1e-6)",
      "100*tanh(w1/1e-9)",
      "100*tanh((w1-5)/1e-8)",
      "1e8*(w1-w2)+sin(1e5*t)",
      "sqrt(w1)+log(w2)",
      "sqrt(abs(w1))",
      "1/w1",
      "1e12+w1",
      "1e-12*w1^3",
      "exp(50*t)",
      "(w1-5)^2*1e-3+1e9*(phi1-phi2)",
      "abs(abs(w1-5)-1e-3)",
      "max(min(w1,1e-4),-1e-4)",
      "w1^3*cos(20*phi1)",
  };
  for (const char* torque : torques) {
    for (const char* start : {"[0, 0]", "[5, 3]", "[1e-4, 0]", "[300, -200]"}) {
      const std::string scene =
          "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\ntorques: [it]\n"
          "it: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"" +
          std::string(torque) + "\"}\nconstraints: [psi]\npsi: {type: " +
          "variator_sim/ExpressionConstraint, order: 2, expression: \"e2-0.5*e1+1e-3*(" + torque +
          ")\"}\ninitial: {velocity: " + start + ", acceleration: [3, 1]}\n";
      EXPECT_EQ(messageOf(scene, Seed::kNothing), "") << torque << start;
    }
  }
}

std::string sceneOf(const std::string& torque, const std::string& constraint,
                    const std::string& velocity, const std::string& acceleration) {
  return "shafts: [a, b]\na: {inertia: 0.3}\nb: {inertia: 2}\ntorques: [it]\nit: {type: "
         "variator_sim/ExpressionTorque, shaft: a, torque: \"" +
         torque + "\"}\nconstraints: [v]\nv: {type: variator_sim/" + constraint +
         "}\ninitial: {velocity: " + velocity + ", acceleration: " + acceleration +
         ", project: true}\n";
}

// The belt's tanh in every state: at its ends the law is a constant but for its tail.
TEST(VerifyDerivatives, AcceptsALawWhereverItSaturates) {
  std::mt19937 random(1);
  const auto number = [&random](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  for (int n = 0; n < 300; ++n) {
    const double low = number(0.2, 1.0);
    const double speed = std::pow(10.0, number(-0.5, 2.5));
    const double width = std::pow(10.0, number(-1.5, 0.5));
    const double w1 = speed * std::pow(10.0, number(-2.0, 1.2)) * (n % 4 == 0 ? -1.0 : 1.0);
    const std::string law = "VBeltRatio, shafts: [a, b], ratio_low: " + std::to_string(low) +
                            ", ratio_high: " + std::to_string(low + number(0.05, 2.0)) +
                            ", speed: " + std::to_string(speed) +
                            ", width: " + std::to_string(width);
    const std::string scene =
        sceneOf("3-0.1*w1", law, "[" + std::to_string(w1) + ", " + std::to_string(low * w1) + "]",
                "[0, 0]");
    ASSERT_EQ(messageOf(scene, Seed::kNothing), "") << scene;
  }
}

/// A formula of t, phi, w (and e) at random, `depth` deep.
std::string randomFormula(std::mt19937& random, int depth, bool has_accelerations) {
  const auto choose = [&random](int count) {
    return static_cast<int>(random() % static_cast<unsigned>(count));
  };
  const auto number = [&] {
    const double size = std::pow(10.0, 0.01 * choose(600) - 3.0);
    return std::to_string(choose(2) == 0 ? size : -size);
  };
  if (depth == 0) {
    const char* const variables[] = {"t", "phi1", "phi2", "w1", "w2", "e1", "e2"};
    return choose(5) < 3 ? variables[choose(has_accelerations ? 7 : 5)] : number();
  }
  const auto part = [&] { return "(" + randomFormula(random, depth - 1, has_accelerations) + ")"; };
  const auto factor = [&] { return number() + "*" + part(); };
  switch (choose(16)) {
    case 0:
    case 1:
      return part() + "+" + part();
    case 2:
      return part() + "-" + part();
    case 3:
    case 4:
      return part() + "*" + part();
    case 5:
      return part() + "/(1+" + part() + "^2)";
    case 6:
      return "1/(1+exp(" + factor() + "))";
    case 7:
    case 8:
      return "tanh(" + factor() + ")";
    case 9:
      return "sin(" + factor() + ")";
    case 10:
      return "atan(" + factor() + ")";
    case 11:
      return "exp(-" + part() + "^2)";
    case 12:
      return "1/cosh(" + part() + ")";
    case 13:
      return "sqrt(1e-4+" + part() + "^2)";
    case 14:
      return "log(1+" + part() + "^2)";
    default:
      return "max(" + part() + ", abs(" + part() + "))";
  }
}

TEST(VerifyDerivatives, AcceptsFormulasAtRandom) {
  std::mt19937 random(3);
  int accepted = 0;
  for (int n = 0; n < 600; ++n) {
    const int order = 1 + n % 3;
    const int depth = 1 + n / 3 % 3;
    const std::string starts[] = {"w2-w1*(0.5+0.1*(", "e2-0.5*e1+3*((", "j2-0.5*j1+0.2*(("};
    const std::string law = "ExpressionConstraint, order: " + std::to_string(order) +
                            ", expression: \"" + starts[order - 1] +
                            randomFormula(random, depth, order > 1) + "))\"";
    const double size = std::pow(10.0, n % 5 - 2);
    const std::string velocity =
        "[" + std::to_string(0.7 * size) + ", " + std::to_string(-0.4 * size) + "]";
    const std::string scene =
        sceneOf(randomFormula(random, depth, false), law, velocity, "[3, -7]");
    const std::string message = messageOf(scene, Seed::kNothing);
    // exp of a large constant, say, is no formula.
    EXPECT_EQ(message.find("verify_derivatives"), std::string::npos) << message << "\n" << scene;
    if (message.empty()) ++accepted;
  }
  EXPECT_GT(accepted, 580);
}

TEST(VerifyDerivatives, AcceptsTheSmallestNumbersAndLargePhases) {
  const std::string any = "ExpressionConstraint, order: 2, expression: e2-e1";
  EXPECT_EQ(messageOf(sceneOf("5e-324*w1", any, "[5, 3]", "[1, 1]"), Seed::kNothing), "");
  EXPECT_EQ(messageOf(sceneOf("1e-310*sin(w1)*w2", any, "[5, 3]", "[1, 1]"), Seed::kNothing), "");
  for (const char* phase : {"9.0e+18", "-1e15", "7", "1e300"}) {
    const std::string scene =
        std::string("shafts: [a]\na: {inertia: 1}\ntorques: [cut]\n") +
        "cut: {type: variator_sim/CuttingTorque, shaft: a, torque: 42, begin: -5, ramp: 1, "
        "tooth_passing: {teeth: 4, amplitude: 0.3, phase: " +
        phase + "}}\ninitial: {velocity: [5]}\n";
    EXPECT_EQ(messageOf(scene, Seed::kNothing), "") << phase;
  }
  // f and its derivatives are denormal numbers: none of its own, but no derivative is wrong.
  const std::string tiny = "ExpressionConstraint, order: 1, expression: \"5e-324*(w2-0.5*w1)\"";
  EXPECT_EQ(
      messageOf(sceneOf("1", tiny, "[2, 1]", "[0, 0]"), Seed::kNothing).find("verify_derivatives"),
      std::string::npos);
}

// Of what differences cannot resolve nothing is asked: formulas are loaded as they are.
TEST(VerifyDerivatives, AsksNothingOfFormulas) {
  const std::string start = "initial: {velocity: [12.4]}\ntorques: [it]\nshafts: [a]\n";
  const char* const laws[] = {
      "torque: \"-6919.2*cos(1e15*t)\"",
      "torque: \"-6919.2*cos(9e18*t)*sin(phi1+1e300)\"",
      "torque: \"tanh(w1/1e-300)*5e-324\"",
      "torque: \"map(w1, 0.5)\"",
      "torque: \"sqrt(w1-12.4+1e-300)+(w1-12.4)^0.5\"",
  };
  for (const char* law : laws) {
    const std::string scene =
        start + "a: {inertia: 1}\ntables: [map]\n" +
        "map: {x: [0, 100], y: [-1.0e+10, 0.5, 1], values: [[0, 1, 2], [3, 4, 6]]}\n" +
        "it: {type: variator_sim/ExpressionTorque, shaft: a, " + law + "}\n";
    SeededFactory factory(Seed::kNothing);
    try {
      readScene(readYamlText(scene, "test"), factory);
    } catch (const SceneError& error) {
      ADD_FAILURE() << law << ": " << error.what();
    }
  }
}

TEST(VerifyDerivatives, AnInputOfOrder1NeedsTwoDerivativesInEveryPlugin) {
  const std::string scene =
      "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 2}\nconstraints: [it]\nit: {type: "
      "test/First, topic: u, ";
  EXPECT_NE(messageOf(scene + "hold: first_order_lag, time_constant: 1}\n", Seed::kNothing)
                .find("second_order_lag"),
            std::string::npos);
  EXPECT_EQ(messageOf(scene + "hold: second_order_lag, time_constant: 1}\n", Seed::kNothing), "");
}

}  // namespace
}  // namespace variator_sim
