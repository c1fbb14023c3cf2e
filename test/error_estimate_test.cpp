// Estimated global errors: against closed forms, by every stepper; estimates leave the motion
// unchanged, and their loss of validity is reported.
#include "motion/error_estimate.h"

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr StepperKind kSteppers[] = {
    StepperKind::kAuto,   StepperKind::kDopri5, StepperKind::kFehlberg78, StepperKind::kRadau,
    StepperKind::kTaylor, StepperKind::kRk4,    StepperKind::kTaylorFixed};

const std::string kCircle =
    test::sceneText("drive 1.5, load 1.5", {"motor on drive: 3*t", "variator: e1^2+e2^2-4"},
                    "initial: {velocity: [0.5, -0.25], acceleration: [1.2, 1.6]}\n"
                    "solver: {relative_tolerance: 1e-7, absolute_tolerance: 1e-7, step: 0.02}");

// One shaft; its motion is known in each case.
std::string freeShaft(const std::string& torque, const std::string& rest = "") {
  return test::sceneText("a 1", {"q on a: " + torque}, rest);
}

/// How many of some estimates are within a factor of ten of the true error, or both at rounding.
struct Coverage {
  int samples = 0;
  int good = 0;
  double largest = 0.0;
  void add(double value, double exact, double estimate) {
    largest = std::max(largest, std::abs(exact));
    const double error = std::abs(value - exact);
    const double rounding = 1e-14 * largest;
    ++samples;
    good += (error <= rounding && estimate <= rounding) ||
            (0.1 * estimate <= error && error <= 10.0 * estimate);
  }
  double part() const { return static_cast<double>(good) / samples; }
};

class ErrorEstimates : public testing::TestWithParam<StepperKind> {};

TEST_P(ErrorEstimates, AreThoseOfTheAccelerationCircle) {
  const double z0 = std::atanh(0.6);
  const auto gd = [](double z) { return 2.0 * std::atan(std::tanh(z / 2.0)); };
  Simulation simulation(test::withStepper(test::sceneFromText(kCircle), GetParam()));
  simulation.estimateErrors(true);
  Coverage columns[4];
  for (int n = 1; n <= 100; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.04 * n).ok()) << simulation.describeStatus();
    const Sample& now = simulation.sample();
    const double z = now.time + z0;
    const double w1 = 0.5 + 2.0 * (std::log(std::cosh(z)) - std::log(std::cosh(z0)));
    columns[0].add(now.acceleration[0], 2.0 * std::tanh(z), now.acceleration_error[0]);
    columns[1].add(now.acceleration[1], 2.0 / std::cosh(z), now.acceleration_error[1]);
    columns[2].add(now.velocity[0], w1, now.velocity_error[0]);
    columns[3].add(now.velocity[1], -0.25 + 2.0 * (gd(z) - gd(z0)), now.velocity_error[1]);
  }
  for (const Coverage& column : columns) EXPECT_GE(column.part(), 0.95) << &column - columns;
}

// A command acts on both motions: w = 2 up to 1 s, then to 5 as 5 - 3 exp(1 - t).
TEST_P(ErrorEstimates, GoOnAcrossACommand) {
  const std::string scene =
      test::sceneText("a 1", {"q on a: -w1", "u on a from u, hold: zero_order, initial: 2"},
                      "initial: {velocity: [2]}\n"
                      "solver: {relative_tolerance: 1e-6, absolute_tolerance: 1e-6, step: 0.05}");
  Simulation simulation(test::withStepper(test::sceneFromText(scene), GetParam()));
  simulation.estimateErrors(true);
  simulation.advanceTo(1.0);
  ASSERT_EQ(simulation.command(0, 5.0), CommandResult::kAccepted);
  Coverage velocity;
  for (int n = 1; n <= 50; ++n) {
    ASSERT_TRUE(simulation.advanceTo(1.0 + 0.04 * n).ok());
    const Sample& now = simulation.sample();
    velocity.add(now.velocity[0], 5.0 - 3.0 * std::exp(1.0 - now.time), now.velocity_error[0]);
  }
  EXPECT_GE(velocity.part(), 0.95);
  EXPECT_LT(simulation.errorDoubt().grown, 0.0);
  EXPECT_LT(simulation.errorDoubt().parted, 0.0);
  EXPECT_LT(simulation.errorDoubt().stopped, 0.0);
}

INSTANTIATE_TEST_SUITE_P(, ErrorEstimates, testing::ValuesIn(kSteppers),
                         [](const auto& test) { return std::string(toString(test.param)); });

TEST(ErrorEstimate, IsTheSameAfterAReset) {
  Simulation simulation(test::withStepper(test::sceneFromText(kCircle), StepperKind::kRadau));
  simulation.estimateErrors(true);
  std::vector<double> errors[2];
  for (std::vector<double>& round : errors) {
    for (int n = 0; n <= 20; ++n) {
      simulation.advanceTo(0.1 * n);
      round.push_back(simulation.sample().velocity_error[0]);
    }
    EXPECT_EQ(simulation.errorDoubt().samples, 20u);
    simulation.reset();
  }
  EXPECT_EQ(errors[0], errors[1]);
}

/// The doubts about a run sampled once a second, as sentences.
std::string doubtsOf(Simulation& simulation, double end) {
  simulation.estimateErrors(true);
  for (double time = 1.0; time <= end; time += 1.0) {
    simulation.advanceTo(time);
    simulation.sample();
  }
  std::string all;
  for (const std::string& sentence : describe(simulation.errorDoubt())) all += sentence + "\n";
  return all;
}

TEST(ErrorEstimate, HasNoDoubtsWhereAllIsWell) {
  Simulation simulation(test::sceneFromText(freeShaft("sin(3*t) - 0.2*w1")));
  EXPECT_EQ(doubtsOf(simulation, 5.0), "");
}

// A pendulum that stands on its head leaves it by what the steps do wrong.
TEST(ErrorEstimate, TellsThatErrorsHaveOutgrownProportion) {
  Simulation simulation(test::sceneFromText(freeShaft("25*sin(phi1)", "initial: {angle: [1e-9]}")));
  const std::string doubts = doubtsOf(simulation, 20.0);
  EXPECT_NE(doubts.find("no longer grow in proportion"), std::string::npos) << doubts;
  EXPECT_GT(simulation.errorDoubt().grown, 3.0);
  EXPECT_TRUE(simulation.status().ok());
}

// The run by its crude steps stays below the limit of steps, what it is compared with does not.
TEST(ErrorEstimate, TellsWhereItEndsWhileTheMotionGoesOn) {
  Simulation simulation(
      test::sceneFromText(freeShaft("100 + if(t < 2.5, 0, 0.01*sin(3000*t))",
                                    "initial: {velocity: [100]}\n"
                                    "solver: {stepper: rk4, step: 0.1, maximum_steps: 12}")));
  const std::string doubts = doubtsOf(simulation, 5.0);
  EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  EXPECT_NE(doubts.find("stopped at t = "), std::string::npos) << doubts;
  EXPECT_NE(doubts.find("(StepLimit)"), std::string::npos) << doubts;
  EXPECT_GT(simulation.errorDoubt().stopped, 2.0);
  EXPECT_TRUE(std::isnan(simulation.sample().velocity_error[0]));
}

// w = 2 t to the last bit: only rounding is left to tell.
TEST(ErrorEstimate, TellsThatOnlyRoundingIsLeft) {
  Simulation simulation(test::sceneFromText(freeShaft("2")));
  const std::string doubts = doubtsOf(simulation, 5.0);
  EXPECT_NE(doubts.find("100 % of the samples, the first one at t = 1 s"), std::string::npos)
      << doubts;
  EXPECT_GT(simulation.sample().velocity_error[0], 0.0);
  EXPECT_LE(simulation.sample().velocity_error[0], 1e-13);
}

// A torque that jumps where the other shaft turns faster than it ever quite does: between the
// largest velocity of the run and that of what it is compared with.
TEST(ErrorEstimate, TellsThatALawJumpsForOneOfBothOnly) {
  const auto scene = [](const std::string& limit) {
    return test::withTolerance(
        test::sceneFromText("a 1, b 1",
                            {"q on a: -4*phi1 - 0.2*w1", "r on b: sign(w1 - (" + limit + "))"},
                            "initial: {angle: [1, 0]}\nsolver: {stepper: dopri5}"),
        1e-5);
  };
  // The maximum of w1, near 2.3 s, and its error there.
  double peak = 0.0;
  double peak_error = 0.0;
  double peak_time = 2.35;
  for (const double spacing : {1e-3, 1e-6}) {
    const double begin = peak_time - 500.0 * spacing;
    Simulation free(scene("9"));
    free.estimateErrors(true);
    for (int n = 0; n < 1000; ++n) {
      free.advanceTo(begin + n * spacing);
      const Sample& now = free.sample();
      if (now.velocity[0] <= peak) continue;
      peak = now.velocity[0];
      peak_error = now.velocity_error[0];
      peak_time = now.time;
    }
  }
  ASSERT_GT(peak_error, 1e-8);
  int told = 0;
  for (const double side : {-0.5, 0.5}) {
    Simulation grazing(scene(test::plainly(peak + side * peak_error)));
    told += doubtsOf(grazing, 5.0).find("differ in how often") != std::string::npos;
  }
  EXPECT_EQ(told, 1);
}

}  // namespace
}  // namespace variator_sim
