// Both arithmetics of series (expression/series_dot.h): products that are rounded before they are
// added, which processors without an instruction for a b + c have, and products that are not.

#include <random>

#include "expression/series_dot.h"
#include "support/machine_code_folder.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

VARIATOR_SIM_BEGIN_FUSED
double dotOfFused(const double* a, const double* b, int count) {
  return expression::fused::vs_dot(a, b, count);
}
VARIATOR_SIM_END_FUSED

class SeriesArithmetic : public test::MachineCodeFolder {
 protected:
  void TearDown() override {
    expression::fuseProducts(true);
    MachineCodeFolder::TearDown();
  }
};

TEST_F(SeriesArithmetic, SumsAreWithinRoundingsOfTheTrueOnes) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> value(-1.0, 1.0);
  for (int count = 0; count <= 40; ++count) {
    std::vector<double> a(static_cast<std::size_t>(count) + 4);
    std::vector<double> b(a.size());
    long double sum = 0.0L;
    for (std::size_t j = 0; j < a.size(); ++j) {
      a[j] = value(random);
      b[j] = value(random);
      if (j < static_cast<std::size_t>(count)) sum += static_cast<long double>(a[j]) * b[j];
    }
    const double expected = static_cast<double>(sum);
    EXPECT_NEAR(expression::plain::vs_dot(a.data(), b.data(), count), expected,
                1e-15 * (1 + count));
    if (!expression::fusesProducts()) continue;
    EXPECT_NEAR(dotOfFused(a.data(), b.data(), count), expected, 1e-15 * (1 + count));
  }
}

/// Returns the states after each half of a second, computed by `machine_code`.
std::vector<double> play(const Scene& like, MachineCode machine_code) {
  Scene scene = like;
  scene.solver.machine_code = machine_code;
  Simulation simulation(scene);
  // Code that makes other bits than the interpreter is refused.
  EXPECT_EQ(simulation.loadMachineCode(true), machine_code == MachineCode::kAlways)
      << simulation.machineCode();
  std::vector<double> values;
  for (int n = 1; n <= 20; ++n) {
    EXPECT_TRUE(simulation.advanceTo(0.5 * n).ok());
    const Sample& at = simulation.sample();
    for (const double* of : {at.angle, at.velocity, at.acceleration}) {
      values.insert(values.end(), of, of + scene.shaftCount());
    }
  }
  return values;
}

class OfFile : public SeriesArithmetic,
               public testing::WithParamInterface<std::pair<const char*, Principle>> {};

TEST_P(OfFile, MachineCodeAndInterpreterAgreeInBoth) {
  constexpr double kTolerance = 1e-9;
  const auto [file, principle] = GetParam();
  Scene scene = test::withTolerance(
      test::sceneFromFile(std::string(VARIATOR_SIM_TEST_DIR) + "/../" + file), kTolerance);
  scene.principle = principle;
  scene.solver.stepper = StepperKind::kTaylor;
  const bool fuses = expression::fusesProducts();
  std::vector<std::vector<double>> of;
  for (const bool is_fused : {false, true}) {
    expression::fuseProducts(is_fused);
    of.push_back(play(scene, MachineCode::kNever));
    EXPECT_EQ(play(scene, MachineCode::kAlways), of.back());
  }
  ASSERT_EQ(of[0].size(), of[1].size());
  for (std::size_t n = 0; n < of[0].size(); ++n) {
    EXPECT_NEAR(of[0][n], of[1][n], 100.0 * kTolerance * std::max(1.0, std::abs(of[0][n])));
  }
  EXPECT_EQ(of[0] == of[1], !fuses) << "one arithmetic stands for both";
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, OfFile,
    testing::Values(std::pair{"benchmark/scenes/ship.yaml", Principle::kGeneralizedGauss},
                    std::pair{"benchmark/scenes/four_shafts.yaml", Principle::kGauss},
                    std::pair{"benchmark/scenes/crank.yaml", Principle::kGeneralizedGauss},
                    std::pair{"benchmark/scenes/four_shafts.yaml", Principle::kGeneralizedGauss},
                    std::pair{"benchmark/scenes/order1.yaml", Principle::kGeneralizedGauss},
                    std::pair{"benchmark/scenes/order3.yaml", Principle::kGeneralizedGauss}),
    [](const auto& of) { return "Scene" + std::to_string(of.index); });

}  // namespace
}  // namespace variator_sim
