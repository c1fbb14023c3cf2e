// Scenes of many shafts, against closed forms and other steppers.
#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// A chain of equal masses of 2 kg m^2 with springs of 300 N m/rad between.
std::string chainOf(int count, const std::vector<double>& angles) {
  std::string shafts = "m0 2";
  std::vector<std::string> springs;
  for (int i = 1; i < count; ++i) {
    const std::string n = std::to_string(i);
    shafts += ", m" + n + " 2";
    springs.push_back("k" + n + " = ElasticCoupling, shafts: [m" + std::to_string(i - 1) + ", m" +
                      n + "], stiffness: 300, damping: 0");
  }
  return test::sceneText(shafts, springs, "initial: {angle: " + test::list(angles) + "}");
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
Scene trainOfVariators(const std::string& principle, const std::string& stepper,
                       const std::string& coupling = "stiffness: 500, damping: 1") {
  std::string shafts;
  std::vector<std::string> elements = {"drive on m0: 50*sin(2*t)"};
  for (int i = 0; i < 64; ++i) {
    const std::string n = std::to_string(i);
    const std::string joint = "shafts: [m" + n + ", m" + std::to_string(i + 1) + "], ";
    shafts += (i == 0 ? "m" : ", m") + n + " " + std::to_string(1 + i % 7);
    elements.push_back("b" + n + " = Friction, shaft: m" + n + ", viscous: 0.3");
    if (i == 63) break;
    elements.push_back(i % 4 == 3 ? "v" + n + " = KinematicRatio, " + joint +
                                        "ratio: \"1 + 0.3*sin(t + " + n + ")\""
                                  : "k" + n + " = ElasticCoupling, " + joint + coupling);
  }
  return test::sceneFromText(shafts, elements,
                             "principle: " + principle + "\nsolver: {stepper: " + stepper +
                                 ", relative_tolerance: 1e-10, absolute_tolerance: 1e-10}");
}

// Newton's matrix of stages is exact where the train is stiff: one without a residual that an
// unknown moves needs far more, and shorter, steps.
TEST(Sizes, FewImplicitStepsMoveAStiffTrain) {
  for (const char* principle : {"gauss", "generalized_gauss"}) {
    Scene scene = trainOfVariators(principle, "radau", "stiffness: 2.0e+6, damping: 2.0e+4");
    scene.solver.relative_tolerance = scene.solver.absolute_tolerance = 1e-6;
    Simulation stiff(std::move(scene));
    ASSERT_TRUE(stiff.advanceTo(1.0).ok()) << stiff.describeStatus();
    EXPECT_LT(stiff.statistics().steps + stiff.statistics().rejected_steps, 60u) << principle;
  }
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
