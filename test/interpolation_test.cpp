// Motions through the kinks and jumps of tables.
#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::list;
using test::sceneText;

const char* const kSteppers[] = {"auto", "rk4", "dopri5", "fehlberg78", "radau", "taylor"};

Simulation simulationOf(const std::string& yaml, const std::string& solver = "") {
  return Simulation(test::sceneFromText(yaml + "solver: {" + solver + "}\n"));
}

TEST(Interpolation, OfACycleByItsCornersIsFollowedExactly) {
  const std::vector<double> x = {0.0, 10.0, 20.0, 20.5, 30.0, 47.3};
  const std::vector<double> v = {0.0, 10.0, 10.0, 3.0, 0.0, 8.0};
  const std::string scene = sceneText("wheel 1, dummy 1", {"cycle of order 1: w_wheel - speed(t)"},
                                      "tables: [speed]\nspeed: {x: " + list(x) +
                                          ", values: " + list(v) + ", interpolation: linear}") +
                            "principle: ";
  for (const std::string principle : {"gauss\n", "generalized_gauss\n"}) {
    for (const char* stepper : kSteppers) {
      SCOPED_TRACE(principle + stepper);
      Simulation simulation = simulationOf(scene + principle, std::string("stepper: ") + stepper);
      double distance = 0.0;
      for (std::size_t k = 1; k < x.size(); ++k) {
        const double middle = 0.5 * (x[k - 1] + x[k]);
        ASSERT_TRUE(simulation.advanceTo(middle).ok()) << simulation.describeStatus();
        EXPECT_NEAR(simulation.sample().velocity[0], 0.5 * (v[k - 1] + v[k]), 1e-9);
        EXPECT_NEAR(simulation.sample().acceleration[0], (v[k] - v[k - 1]) / (x[k] - x[k - 1]),
                    1e-8);
        ASSERT_TRUE(simulation.advanceTo(x[k]).ok()) << simulation.describeStatus();
        distance += 0.5 * (v[k - 1] + v[k]) * (x[k] - x[k - 1]);
        EXPECT_NEAR(simulation.sample().velocity[0], v[k], 1e-9);
        EXPECT_NEAR(simulation.sample().angle[0], distance, 1e-9 * (1.0 + distance));
      }
    }
  }
}

/// A torque over time, T(t): J w' = T(t), in closed form.
TEST(Interpolation, OfTorquesOverTimeIsIntegratedInItsPieces) {
  const std::vector<double> x = {0.0, 1.0, 1.5, 4.0};
  const std::vector<double> T = {1.0, 3.0, -2.0, 5.0};
  for (const bool holds : {false, true}) {
    const std::string scene =
        sceneText("a 2", {"pull on a: T(t)"},
                  "tables: [T]\nT: {x: " + list(x) + ", values: " + list(T) +
                      ", interpolation: " + (holds ? "hold" : "linear") + "}") +
        "principle: ";
    for (const std::string principle : {"gauss\n", "generalized_gauss\n"}) {
      for (const char* stepper : kSteppers) {
        SCOPED_TRACE(principle + stepper + (holds ? " hold" : " linear"));
        Simulation simulation = simulationOf(scene + principle, std::string("stepper: ") + stepper);
        double momentum = 0.0;
        for (std::size_t k = 1; k < x.size(); ++k) {
          ASSERT_TRUE(simulation.advanceTo(x[k]).ok()) << simulation.describeStatus();
          momentum += (holds ? T[k - 1] : 0.5 * (T[k - 1] + T[k])) * (x[k] - x[k - 1]);
          EXPECT_NEAR(2.0 * simulation.sample().velocity[0], momentum, 1e-8);
        }
        ASSERT_TRUE(simulation.advanceTo(6.0).ok());
        EXPECT_NEAR(2.0 * simulation.sample().velocity[0], momentum + 2.0 * T[3], 1e-8);
      }
    }
  }
}

/// w' = T(w) with straight lines between points: w is an exponential in each piece. Returns the
/// instant at which w has come from the first to the last of `w`.
double calcPassage(const std::vector<double>& w, const std::vector<double>& T, double inertia) {
  double time = 0.0;
  for (std::size_t k = 1; k < w.size(); ++k) {
    const double slope = (T[k] - T[k - 1]) / (w[k] - w[k - 1]);
    time += inertia * (slope == 0.0 ? (w[k] - w[k - 1]) / T[k] : std::log(T[k] / T[k - 1]) / slope);
  }
  return time;
}

TEST(Interpolation, OfTorquesOverSpeedMeetsTheClosedForm) {
  for (const int points : {5, 1001}) {
    std::vector<double> w;
    std::vector<double> T;
    for (int k = 0; k < points; ++k) {
      w.push_back(100.0 * k / (points - 1));
      T.push_back(k % 2 == 0 ? 50.0 : 20.0 + k % 7);
    }
    const double end = calcPassage(w, T, 0.8);
    const std::string scene = sceneText("a 0.8", {"pull on a: T(w_a)"},
                                        "tables: [T]\nT: {x: " + list(w) + ", values: " + list(T) +
                                            ", interpolation: linear}") +
                              "principle: ";
    for (const std::string principle : {"gauss\n", "generalized_gauss\n"}) {
      for (const char* stepper : {"auto", "dopri5", "radau", "taylor"}) {
        SCOPED_TRACE(principle + stepper + " " + std::to_string(points));
        Simulation simulation = simulationOf(scene + principle, std::string("stepper: ") + stepper);
        ASSERT_TRUE(simulation.advanceTo(end).ok()) << simulation.describeStatus();
        EXPECT_NEAR(simulation.sample().velocity[0], 100.0, 2e-6);
        EXPECT_GE(simulation.statistics().kinks, points - 2);
      }
    }
  }
}

/// A shaft that swings through the points of a table, to and fro, at whose points it also turns.
TEST(Interpolation, IsFollowedInBothDirections) {
  const std::string scene = sceneText("a 1", {"pull on a: spring(phi_a)"}, R"(
tables: [spring]
spring: {x: [-2, -1, 1, 2], values: [14, 1, -1, -14], interpolation: linear, beyond: linear}
initial: {angle: [1]}
)");
  // Up to |phi| = 1 the spring has the stiffness 1: cos t. (A fixed step from a point is of first
  // order.)
  for (const char* stepper : {"auto", "dopri5", "fehlberg78", "radau", "taylor"}) {
    SCOPED_TRACE(stepper);
    Simulation simulation = simulationOf(scene, std::string("stepper: ") + stepper);
    for (const double t : {0.7, 3.0, 3.14159265358979, 10.0}) {
      ASSERT_TRUE(simulation.advanceTo(t).ok()) << simulation.describeStatus();
      EXPECT_NEAR(simulation.sample().angle[0], std::cos(t), 1e-6) << t;
    }
  }
}

TEST(Interpolation, OfTwoVariablesIsBilinearInItsPieces) {
  const std::string scene = sceneText("a 1", {"pull on a: map(t, w_a)"}, R"(
tables: [map]
map: {x: [0, 1, 2, 8], y: [0, 2, 3, 10], interpolation: linear,
      values: [[0, 2, 3, 10], [1, 3, 4, 11], [2, 4, 5, 12], [8, 10, 11, 18]]}
)");
  // The map is x + y: w' = t + w.
  Simulation simulation = simulationOf(scene);
  ASSERT_TRUE(simulation.advanceTo(2.0).ok());
  EXPECT_NEAR(simulation.sample().velocity[0], std::exp(2.0) - 3.0, 1e-7);
}

TEST(Interpolation, IsToldWhereASmoothTableIsFarOffItsLines) {
  const auto warningsOf = [](const std::string& keys) {
    return test::sceneFromText("shafts: [a]\na: {inertia: 1}\ntables: [speed]\nspeed: {" + keys +
                               "}\n")
        .warnings;
  };
  const std::string coarse = "x: [0, 10, 20, 30], values: [0, 10, 10, 0]";
  const std::vector<std::string> told = warningsOf(coarse);
  ASSERT_EQ(told.size(), 1U);
  for (const char* word : {"'speed'", "15 %", "interpolation: linear", "interpolation: smooth"}) {
    EXPECT_NE(told[0].find(word), std::string::npos) << told[0];
  }
  EXPECT_TRUE(warningsOf(coarse + ", interpolation: smooth").empty());
  EXPECT_TRUE(warningsOf(coarse + ", interpolation: linear").empty());
  EXPECT_TRUE(warningsOf("x: [0, 1, 2, 3], values: [0, 1, 2, 3], beyond: linear").empty());
  EXPECT_EQ(warningsOf("x: [0, 1, 2], y: [0, 1], values: [[0, 1], [5, 5], [0, 1]]").size(), 1U);
}

}  // namespace
}  // namespace variator_sim
