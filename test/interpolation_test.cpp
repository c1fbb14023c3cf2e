// Motions through the kinks of many points, and what is told of a coarse table
// (test/known_motions.yaml has motions through those of few).
#include "support/scenes.h"

namespace variator_sim {
namespace {

using test::list;
using test::sceneText;

Simulation simulationOf(const std::string& yaml, const std::string& solver = "") {
  return Simulation(test::sceneFromText(yaml + "solver: {" + solver + "}\n"));
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
