// Both arithmetics of series (expression/series_dot.h): products that are rounded before they are
// added, which processors without an instruction for a b + c have, and products that are not.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "expression/series_dot.h"
#include "support/machine_code_folder.h"
#include "support/scenes.h"
#include "variator_sim/simulation.h"

namespace variator_sim {
namespace {

using std::cos;
using std::sin;
#include "expression/series_sine.inc"

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

/// Against sinl and cosl, whose 64 or more digits are the library's own.
TEST(SeriesSine, IsWithinNineTenthsOfAUnitInTheLastPlace) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> mantissa(-1.0, 1.0);
  std::uniform_int_distribution<int> exponent(-30, 20);
  const auto units = [](double value, long double exact) {
    int e = 0;
    std::frexp(static_cast<double>(exact), &e);
    return static_cast<double>(std::abs(value - exact) / std::ldexp(1.0L, e - 53));
  };
  double worst = 0.0;
  for (int n = 0; n < 1000000; ++n) {
    const double x = std::ldexp(mantissa(random), exponent(random));
    double sine, cosine;
    sineAndCosine(x, &sine, &cosine);
    worst = std::max(worst, units(sine, std::sin(static_cast<long double>(x))));
    worst = std::max(worst, units(cosine, std::cos(static_cast<long double>(x))));
  }
  EXPECT_LT(worst, 0.9);
}

/// Arguments that agree with n pi / 2 in nearly all digits.
TEST(SeriesSine, IsGoodBesideItsZeros) {
  constexpr long double kHalfPi = 1.570796326794896619231321691639751442L;
  for (int n = 1; n < 667000; ++n) {
    const double x = static_cast<double>(n * kHalfPi);
    double value[2];
    sineAndCosine(x, value, value + 1);
    const double exact[2] = {std::sin(x), std::cos(x)};
    for (int i = 0; i < 2; ++i) {
      ASSERT_NEAR(value[i], exact[i], 2.3e-16 * std::abs(exact[i]) + 1e-29) << n;
    }
  }
}

/// Beyond its reach, and of what is no number.
TEST(SeriesSine, IsTheLibrarysFarAway) {
  for (const double x : {0x1p20, -0x1.8p20, 1e9, 1e300}) {
    double sine, cosine;
    sineAndCosine(x, &sine, &cosine);
    EXPECT_EQ(sine, std::sin(x));
    EXPECT_EQ(cosine, std::cos(x));
  }
  for (const double x : {HUGE_VAL, -HUGE_VAL, std::nan("")}) {
    double sine, cosine;
    sineAndCosine(x, &sine, &cosine);
    EXPECT_TRUE(std::isnan(sine));
    EXPECT_TRUE(std::isnan(cosine));
  }
}

/// Returns the states after each tenth of a second, computed by `machine_code`.
std::vector<double> play(const Scene& like, MachineCode machine_code) {
  Scene scene = like;
  scene.solver.machine_code = machine_code;
  Simulation simulation(scene);
  // Code that makes other bits than the interpreter is refused.
  EXPECT_EQ(simulation.loadMachineCode(true), machine_code == MachineCode::kAlways)
      << simulation.machineCode();
  std::vector<double> values;
  for (int n = 1; n <= 20; ++n) {
    EXPECT_TRUE(simulation.advanceTo(0.1 * n).ok());
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
