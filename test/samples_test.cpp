// Samples inside of steps by series: within the tolerance at every time, rates of the reaction
// included, and on the constraints to rounding.
#include "support/scenes.h"

namespace variator_sim {
namespace {

struct Case {
  std::string name;
  double end;    // s
  double grows;  // tolerances: what errors of steps add up to
};

std::string nameOf(const testing::TestParamInfo<Case>& info) {
  return info.param.name;
}

class SamplesOfSteps : public testing::TestWithParam<Case> {
 protected:
  static constexpr int kSamples = 211;  // several in each step, and none at its ends
  Scene scene() const {
    const std::string folder = VARIATOR_SIM_TEST_DIR "/../benchmark/scenes/";
    return test::sceneFromFile(folder + GetParam().name + ".yaml");
  }
  double timeOf(int n) const { return GetParam().end * n / kSamples; }
};

double errorOf(const double* values, const double* exact, int count) {
  double largest = 0.0;
  for (int i = 0; i < count; ++i) {
    largest = std::max(largest, std::abs(values[i] - exact[i]) / (1.0 + std::abs(exact[i])));
  }
  return largest;
}

// Beside Boost's Fehlberg method at its smallest tolerance.
TEST_P(SamplesOfSteps, AreWithinTheToleranceInEveryColumn) {
  Simulation reference(
      test::withStepper(test::withTolerance(scene(), 1e-13), StepperKind::kFehlberg78));
  std::vector<Sample> exact;
  for (int n = 1; n <= kSamples; ++n) {
    reference.advanceTo(timeOf(n));
    exact.push_back(reference.sample());
  }
  const int S = scene().shaftCount();
  const int k = scene().constraintCount();
  for (const double tolerance : {1e-4, 1e-7, 1e-10}) {
    SCOPED_TRACE(tolerance);
    Simulation simulation(test::withTolerance(scene(), tolerance));
    double state = 0.0;
    double torques = 0.0;
    double rates = 0.0;
    double residuals = 0.0;
    for (int n = 1; n <= kSamples; ++n) {
      ASSERT_TRUE(simulation.advanceTo(timeOf(n)).ok());
      const Sample& is = simulation.sample();
      const Sample& should = exact[static_cast<std::size_t>(n - 1)];
      EXPECT_EQ(is.time, should.time);
      state = std::max({state, errorOf(is.angle, should.angle, S),
                        errorOf(is.velocity, should.velocity, S),
                        errorOf(is.acceleration, should.acceleration, S)});
      torques = std::max({torques, errorOf(is.applied_torque, should.applied_torque, S),
                          errorOf(is.reaction_torque, should.reaction_torque, S)});
      rates = std::max({rates, errorOf(is.reaction_torque_rate, should.reaction_torque_rate, S),
                        errorOf(is.multiplier, should.multiplier, k)});
      for (int m = 0; m < k; ++m) residuals = std::max(residuals, std::abs(is.residual[m]));
    }
    // (Lambda of a series alone has errors of some hundred tolerances inside of steps.)
    const double allowed = GetParam().grows * tolerance;
    EXPECT_LT(state, allowed);
    EXPECT_LT(torques, 2.0 * allowed);
    EXPECT_LT(rates, 5.0 * allowed);
    EXPECT_LT(residuals, 1e-12);
  }
}

// Q, R and R' are those of the accelerations beside them: what is read off twice agrees.
TEST_P(SamplesOfSteps, KeepTheirColumnsTogether) {
  Simulation simulation(test::withTolerance(scene(), 1e-9));
  const int S = scene().shaftCount();
  constexpr double kApart = 1e-5;  // s
  for (int n = 2; n <= kSamples; n += 7) {
    simulation.advanceTo(timeOf(n) - kApart);
    const Sample before = simulation.sample();
    simulation.advanceTo(timeOf(n));
    const Sample now = simulation.sample();
    simulation.advanceTo(timeOf(n) + kApart);
    const Sample& behind = simulation.sample();
    const auto rateOf = [&](const double* late, const double* early) {
      return (*late - *early) / (2.0 * kApart);
    };
    for (int i = 0; i < S; ++i) {
      const double size = 1.0 + std::abs(now.reaction_torque_rate[i]);
      EXPECT_NEAR(rateOf(behind.reaction_torque + i, before.reaction_torque + i),
                  now.reaction_torque_rate[i], 1e-4 * size);
      EXPECT_NEAR(rateOf(behind.velocity + i, before.velocity + i), now.acceleration[i],
                  1e-5 * (1.0 + std::abs(now.acceleration[i])));
      EXPECT_NEAR(rateOf(behind.angle + i, before.angle + i), now.velocity[i],
                  1e-5 * (1.0 + std::abs(now.velocity[i])));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Benchmarks, SamplesOfSteps,
                         testing::Values(Case{"ship", 20.0, 8.0}, Case{"smooth_linear", 20.0, 4.0},
                                         Case{"acceleration_circle", 4.0, 4.0},
                                         Case{"four_shafts", 10.0, 12.0}, Case{"crank", 2.0, 30.0},
                                         Case{"order1", 20.0, 4.0}, Case{"order3", 20.0, 4.0}),
                         nameOf);

// Accelerations that follow from the state: those of a sample inside an implicit step are within
// the tolerance, and a sample costs no step.
class SamplesOfImplicitSteps : public testing::TestWithParam<std::string> {
 protected:
  static constexpr int kSamples = 1811;
  static constexpr double kEnd = 18.0;  // s
  Scene scene(double tolerance) const {
    const std::string folder = VARIATOR_SIM_TEST_DIR "/../config/applications/";
    return test::withTolerance(test::sceneFromFile(folder + GetParam() + ".yaml"), tolerance);
  }
  /// All inputs are at 0.4 of their largest values from 1 s on.
  static std::vector<Sample> play(Simulation* simulation, int samples) {
    const auto& inputs = simulation->scene().inputs;
    simulation->advanceTo(1.0);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      simulation->command(static_cast<int>(i), 0.4 * inputs[i].maximum);
    }
    std::vector<Sample> all;
    for (int n = 1; n <= samples; ++n) {
      simulation->advanceTo(1.0 + kEnd * n / samples);
      EXPECT_TRUE(simulation->status().ok());
      all.push_back(simulation->sample());
    }
    return all;
  }
};

TEST_P(SamplesOfImplicitSteps, AreWithinTheTolerance) {
  Simulation reference(test::withStepper(scene(1e-12), StepperKind::kFehlberg78));
  const std::vector<Sample> exact = play(&reference, kSamples);
  for (const double tolerance : {1e-3, 1e-5, 1e-7, 1e-9}) {
    SCOPED_TRACE(tolerance);
    Simulation simulation(test::withStepper(scene(tolerance), StepperKind::kRadau));
    const std::vector<Sample> samples = play(&simulation, kSamples);
    double worst = 0.0;
    for (std::size_t n = 0; n < samples.size(); ++n) {
      const int S = simulation.scene().shaftCount();
      worst = std::max({worst, errorOf(samples[n].velocity, exact[n].velocity, S),
                        errorOf(samples[n].acceleration, exact[n].acceleration, S)});
    }
    EXPECT_LT(worst, tolerance);
  }
}

TEST_P(SamplesOfImplicitSteps, CostNoStep) {
  Simulation sampled(test::withStepper(scene(1e-6), StepperKind::kRadau));
  Simulation plain(test::withStepper(scene(1e-6), StepperKind::kRadau));
  play(&sampled, kSamples);
  play(&plain, 1);
  const auto evaluations =
      sampled.statistics().right_hand_sides - plain.statistics().right_hand_sides;
  EXPECT_LT(static_cast<double>(evaluations), 4.0 * kSamples);
}

INSTANTIATE_TEST_SUITE_P(Applications, SamplesOfImplicitSteps,
                         testing::Values("machine_tool", "car"));

// A command that is late acts at the very instant, whether or not something was asked before.
TEST(SampleOfAStep, OfTheInstantOfATimeoutIsBehindIt) {
  const Scene scene = test::sceneFromText(
      "free 2", {"push on free from u, initial: 4, timeout: 0.5, on_timeout: zero"});
  Simulation often(scene);
  Simulation once(scene);
  for (Simulation* simulation : {&often, &once}) simulation->command(0, 6.0);
  for (int n = 1; n <= 10; ++n) {
    often.advanceTo(0.05 * n);
    often.sample();
  }
  once.advanceTo(0.5);
  EXPECT_EQ(often.sample().applied_torque[0], once.sample().applied_torque[0]);
  EXPECT_EQ(often.sample().velocity[0], once.sample().velocity[0]);
}

}  // namespace
}  // namespace variator_sim
