// Scenes of many shafts, against closed forms and other steppers.
#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// A chain of equal masses of 2 kg m^2 with springs of 300 N m/rad between.
std::string chainOf(int count, const std::vector<double>& angles) {
  std::ostringstream shafts;
  std::ostringstream elements;
  std::ostringstream torques;
  std::ostringstream start;
  start.precision(17);
  for (int i = 0; i < count; ++i) {
    shafts << (i == 0 ? "" : ", ") << "m" << i;
    start << (i == 0 ? "" : ", ") << angles[static_cast<std::size_t>(i)];
    elements << "m" << i << ": {inertia: 2}\n";
    if (i == 0) continue;
    torques << (i == 1 ? "" : ", ") << "k" << i;
    elements << "k" << i << ": {type: variator_sim/ElasticCoupling, shafts: [m" << i - 1 << ", m"
             << i << "], stiffness: 300, damping: 0}\n";
  }
  return "shafts: [" + shafts.str() + "]\n" + elements.str() + "torques: [" + torques.str() +
         "]\ninitial: {angle: [" + start.str() + "]}\n";
}

// Mode k of a free chain of n masses: phi_i = cos(pi k (i + 1/2)/n) cos(w_k t) with w_k = 2
// sqrt(c/J) sin(pi k/(2 n)).
TEST(Sizes, AChainSwingsInItsModes) {
  for (const int count : {9, 24, 64}) {
    for (const int mode : {1, 5}) {
      std::vector<double> shape;
      for (int i = 0; i < count; ++i) shape.push_back(std::cos(kPi * mode * (i + 0.5) / count));
      Scene scene = test::sceneFromText(chainOf(count, shape));
      scene.solver.relative_tolerance = scene.solver.absolute_tolerance = 1e-11;
      Simulation simulation(std::move(scene));
      const double frequency = 2.0 * std::sqrt(150.0) * std::sin(kPi * mode / (2.0 * count));
      for (int n = 1; n <= 5; ++n) {
        ASSERT_TRUE(simulation.advanceTo(0.7 * n).ok()) << simulation.describeStatus();
        const Sample& sample = simulation.sample();
        for (std::size_t i = 0; i < shape.size(); ++i) {
          EXPECT_NEAR(sample.angle[i], shape[i] * std::cos(frequency * 0.7 * n), 1e-9)
              << count << " masses, " << i;
        }
      }
    }
  }
}

/// 64 shafts, with a variator at every fourth joint, whose ratio moves.
Scene trainOfVariators(const std::string& principle, const std::string& stepper) {
  std::string shafts;
  std::string torques = "drive";
  std::string constraints;
  std::string elements =
      "drive: {type: variator_sim/ExpressionTorque, shaft: m0, torque: "
      "\"50*sin(2*t)\"}\n";
  for (int i = 0; i < 64; ++i) {
    const std::string n = std::to_string(i);
    const std::string joint = "shafts: [m" + n + ", m" + std::to_string(i + 1) + "], ";
    shafts += (i == 0 ? "m" : ", m") + n;
    elements += "m" + n + ": {inertia: " + std::to_string(1 + i % 7) + "}\nb" + n +
                ": {type: variator_sim/Friction, shaft: m" + n + ", viscous: 0.3}\n";
    torques += ", b" + n;
    if (i == 63) break;
    if (i % 4 == 3) {
      constraints += (constraints.empty() ? "v" : ", v") + n;
      elements += "v" + n + ": {type: variator_sim/KinematicRatio, " + joint +
                  "ratio: \"1 + 0.3*sin(t + " + n + ")\"}\n";
    } else {
      torques += ", k" + n;
      elements += "k" + n + ": {type: variator_sim/ElasticCoupling, " + joint +
                  "stiffness: 500, damping: 1}\n";
    }
  }
  return test::sceneFromText("shafts: [" + shafts + "]\ntorques: [" + torques +
                             "]\nconstraints: [" + constraints + "]\n" + elements +
                             "principle: " + principle + "\nsolver: {stepper: " + stepper +
                             ", relative_tolerance: 1e-10, absolute_tolerance: 1e-10}\n");
}

// The steppers have no text in common: the series solve for the reactions by the program's rows,
// Radau's and Fehlberg's methods by those of the constraints.
TEST(Sizes, SixtyFourShaftsMoveAlikeByAllSteppers) {
  for (const char* principle : {"gauss", "generalized_gauss"}) {
    Simulation series(trainOfVariators(principle, "taylor"));
    ASSERT_TRUE(series.advanceTo(1.0).ok()) << series.describeStatus();
    const Sample expected = series.sample();
    for (int m = 0; m < 15; ++m) EXPECT_LT(std::abs(expected.residual[m]), 1e-9);
    for (const char* stepper : {"radau", "fehlberg78"}) {
      Simulation other(trainOfVariators(principle, stepper));
      ASSERT_TRUE(other.advanceTo(1.0).ok()) << other.describeStatus();
      for (int i = 0; i < 64; ++i) {
        EXPECT_NEAR(other.sample().velocity[i], expected.velocity[i], 1e-8)
            << principle << ", " << stepper << ", shaft " << i;
        EXPECT_NEAR(other.sample().reaction_torque[i], expected.reaction_torque[i], 1e-7)
            << principle << ", " << stepper << ", shaft " << i;
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim
