// Scenes that need less than others, as no angles or the expected commands alone, move as all do.

#include <ostream>

#include "motion/command_rhythm.h"
#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr double kTolerance = 1e-11;
constexpr double kEnd = 2.0;

struct SkipScene {
  const char* name;
  std::string yaml;
  bool reads_angles;
};

// How a scene is shown when it fails.
void PrintTo(const SkipScene& scene, std::ostream* out) {
  *out << scene.name;
}

const SkipScene kScenes[] = {
    {"Ship",
     test::sceneText(
         "drive 0.8, load 2",
         {"motor on drive: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)", "propeller on load: -0.02*w2^2",
          "variator: 0.2*(e2-(0.6+0.2*sin(0.7*t))*e1)*(1+0.05*(e1^2+e2^2)) + "
          "w2-(0.6+0.2*sin(0.7*t))*w1"},
         "initial: {velocity: [5, 2]}"),
     false},
    {"ConstantSlip",
     test::sceneText(
         "drive 0.8, load 2",
         {"motor on drive from torque, hold: first_order_lag, time_constant: 0.3, initial: 2",
          "propeller on load: -0.02*w2^2+sin(t)",
          "variator = SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6"},
         "initial: {velocity: [5, 2]}"),
     false},
    {"CommandedSlip",
     test::sceneText("drive 0.8, load 2",
                     {"propeller on load: -0.02*w2^2+sin(t)",
                      "variator = SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: "
                      "{topic: ratio, initial: 0.6}"},
                     "initial: {velocity: [5, 2]}"),
     false},
    {"FourShaftsTwoConstraints",
     test::sceneText("a 0.8, b 0.5, c 2, d 1.1",
                     {"motor on a: 5*sin(3*t)-0.1*w1", "friction on d: -0.3*w4-0.1*tanh(w3)",
                      "spring = ElasticCoupling, shafts: [b, c], stiffness: 30, damping: 1",
                      "one = SlipRatio, shafts: [a, b], time_constant: 0.2, ratio: 0.6",
                      "two = SlipRatio, shafts: [c, d], time_constant: 0.4, ratio: -1.5"},
                     "inertia_coupling: [[a, b, 0.1]]\n"
                     "initial: {velocity: [5, 3, 2, -3]}"),
     false},
    {"ElasticCouplingUnderGauss",
     test::sceneText(
         "drive 0.8, load 2",
         {"coupling = ElasticCoupling, shafts: [drive, load], stiffness: 60, damping: 2",
          "motor on drive: 3+sin(2*t)-0.2*w1"},
         "principle: gauss\n"
         "initial: {angle: [0.1, 0], velocity: [5, 2]}"),
     true},
    {"CrankInertia",
     test::sceneText(
         "engine, load 3",
         {"motor on engine: 25-0.4*w1", "drag on load: -0.03*w2^2",
          "variator = SlipRatio, shafts: [engine, load], time_constant: 0.4, ratio: 0.7"},
         "engine: {inertia: {mean: 1, harmonics: [{order: 1, cos: 0.15}, {order: 2, cos: 0.05, "
         "sin: 0.02}]}}\n"
         "initial: {velocity: [10, 7]}"),
     true},
    {"OrderOne",
     test::sceneText("drive 0.3, load 1.1",
                     {"motor on drive: 20-0.5*w1", "drag on load: -2-0.01*w2^2",
                      "variator of order 1: w2-(0.5+0.1*t)*w1"},
                     "initial: {velocity: [4, 2]}"),
     false},
    {"ConstantOrderOneUnderGauss",
     test::sceneText("drive 0.3, load 1.1",
                     {"motor on drive: 20-0.5*w1", "drag on load: -2-0.01*w2^2",
                      "gear = KinematicRatio, shafts: [drive, load], ratio: 0.5"},
                     "principle: gauss\n"
                     "initial: {velocity: [4, 2]}"),
     false},
    {"TorqueThatReadsTheAngle",
     test::sceneText(
         "drive 0.8, load 2",
         {"motor on drive: 6*sin(2*phi1)-0.3*w1", "cam on load: -2*cos(phi2-phi1)-0.1*w2",
          "variator = SlipRatio, shafts: [drive, load], time_constant: 0.2, ratio: 0.6"},
         "initial: {velocity: [5, 2]}"),
     true},
    {"ConstraintThatReadsTheAngle",
     test::sceneText("drive 0.8, load 2",
                     {"motor on drive: 6-0.3*w1",
                      "variator: 0.2*(e2-(0.6+0.1*sin(phi1))*e1)+w2-(0.6+0.1*sin(phi1))*w1"},
                     "initial: {velocity: [5, 3]}"),
     true},
};

struct Result {
  std::vector<Sample> samples;  // inside steps too
  Statistics statistics;
};

Result run(Scene scene) {
  Simulation simulation(std::move(scene));
  Result result;
  for (int n = 1; n <= 20; ++n) {
    simulation.advanceTo(kEnd * n / 20.0);
    if (n == 10 && simulation.scene().inputCount() > 0) simulation.command(0, 0.7);
    result.samples.push_back(simulation.sample());
  }
  EXPECT_TRUE(simulation.status().ok()) << toString(simulation.status().reason);
  result.statistics = simulation.statistics();
  return result;
}

void expectSameMotion(const Result& a, const Result& b, double tolerance) {
  ASSERT_EQ(a.samples.size(), b.samples.size());
  for (std::size_t n = 0; n < a.samples.size(); ++n) {
    const auto near = [&](const double* x, const double* y, const char* what) {
      double scale = 1.0;
      for (int i = 0; i < kMaxShafts; ++i) scale = std::max(scale, std::abs(y[i]));
      for (int i = 0; i < kMaxShafts; ++i) {
        EXPECT_NEAR(x[i], y[i], tolerance * scale) << what << " " << i << ", sample " << n;
      }
    };
    near(a.samples[n].angle, b.samples[n].angle, "angle");
    near(a.samples[n].velocity, b.samples[n].velocity, "velocity");
    near(a.samples[n].acceleration, b.samples[n].acceleration, "acceleration");
    near(a.samples[n].reaction_torque, b.samples[n].reaction_torque, "reaction");
  }
}

class Skips : public testing::TestWithParam<SkipScene> {
 protected:
  Scene scene(StepperKind stepper, double tolerance = kTolerance) const {
    return test::withStepper(test::withTolerance(test::sceneFromText(GetParam().yaml), tolerance),
                             stepper);
  }
};

// Another scheme at a tighter tolerance.
TEST_P(Skips, LeaveTheMotionRight) {
  const Result exact = run(scene(StepperKind::kFehlberg78, 1e-12));
  for (StepperKind stepper :
       {StepperKind::kAuto, StepperKind::kDopri5, StepperKind::kFehlberg78, StepperKind::kTaylor}) {
    SCOPED_TRACE(toString(stepper));
    expectSameMotion(run(scene(stepper)), exact, 1e-8);
  }
  SCOPED_TRACE(toString(StepperKind::kRadau));
  expectSameMotion(run(scene(StepperKind::kRadau, 1e-7)), exact, 1e-4);
}

// The table above has scenes of both kinds: where angles are read, the motion from other angles is
// another one.
TEST_P(Skips, KnowWhetherAnglesAreRead) {
  Scene turned = scene(StepperKind::kFehlberg78);
  for (double& angle : turned.initial.angle) angle += 0.5;
  if (GetParam().reads_angles) turned.initial.angle[1] += 0.4;  // couplings feel this one only
  const Sample a = run(scene(StepperKind::kFehlberg78)).samples.back();
  const Sample b = run(std::move(turned)).samples.back();
  const double change = std::abs(a.velocity[0] - b.velocity[0]);
  if (GetParam().reads_angles) {
    EXPECT_GT(change, 1e-4);
  } else {
    EXPECT_LT(change, 1e-8);
  }
}

const std::string kCommanded = test::sceneText(
    "drive 0.8, load 2",
    {"motor on drive from torque, hold: zero_order, initial: 2", "propeller on load: -0.02*w2^2",
     "variator: 0.2*(e2-0.6*e1)*(1+0.05*(e1^2+e2^2)) + w2-0.6*w1"},
    "initial: {velocity: [5, 3]}");

/// Commands at multiples of `interval` ns, `shift` s later, but for the n-th where `comes(n)` is
/// false; samples between them.
template <class Comes>
Result runCommanded(StepperKind stepper, double tolerance, std::int64_t interval, double shift,
                    Comes comes) {
  Simulation simulation(
      test::withStepper(test::withTolerance(test::sceneFromText(kCommanded), tolerance), stepper));
  Result result;
  for (std::int64_t n = 1; n <= 40; ++n) {
    simulation.advanceTo(static_cast<double>(n * interval) / 1e9 + shift);
    if (comes(n)) simulation.command(0, 3.0 + 2.0 * std::sin(0.7 * static_cast<double>(n)));
    simulation.advanceTo(static_cast<double>(n * interval + interval / 3) / 1e9);
    result.samples.push_back(simulation.sample());
  }
  EXPECT_TRUE(simulation.status().ok()) << simulation.describeStatus();
  result.statistics = simulation.statistics();
  return result;
}

// A step that ends where the next command is expected is not made again up to there. A shift by
// less than a nanosecond takes commands out of the rhythm, and changes nothing else.
TEST(CommandRhythm, SparesStepsUpToCommands) {
  const auto always = [](std::int64_t) { return true; };
  for (StepperKind stepper : {StepperKind::kDopri5, StepperKind::kFehlberg78}) {
    SCOPED_TRACE(toString(stepper));
    const Result regular = runCommanded(stepper, 1e-9, 1000000, 0.0, always);
    const Result shifted = runCommanded(stepper, 1e-9, 1000000, 1e-10, always);
    EXPECT_LE(regular.statistics.right_hand_sides, shifted.statistics.right_hand_sides);
    EXPECT_EQ(regular.statistics.jumps, shifted.statistics.jumps);
    expectSameMotion(regular, shifted, 1e-8);
  }
}

TEST(CommandRhythm, MayBreakOffAndBeginAgain) {
  const auto with_gaps = [](std::int64_t n) { return n % 9 != 0 && n / 7 != 3 && n != 31; };
  for (std::int64_t interval : {1000000, 50000000, 333333333}) {
    const Result exact = runCommanded(StepperKind::kFehlberg78, 1e-12, interval, 1e-12, with_gaps);
    for (StepperKind stepper : {StepperKind::kAuto, StepperKind::kDopri5, StepperKind::kFehlberg78,
                                StepperKind::kRadau, StepperKind::kTaylor}) {
      SCOPED_TRACE(std::string(toString(stepper)) + " " + std::to_string(interval) + " ns");
      expectSameMotion(runCommanded(stepper, 1e-8, interval, 0.0, with_gaps), exact, 1e-6);
    }
  }
}

// The end of a ramp and the next expected command are a rounding apart.
TEST(CommandRhythm, GoesWithRamps) {
  for (const char* principle : {"generalized_gauss", "gauss"}) {
    for (int period : {1, 3, 7, 10, 33, 70, 100}) {  // ms
      Scene scene = test::sceneFromText(
          "a 0.8, b 2",
          {"m on a from u, hold: first_order_hold, period: " + std::to_string(0.001 * period),
           "slip = SlipRatio, shafts: [a, b], time_constant: 0.1, ratio: 0.5"},
          std::string("initial: {velocity: [4, 2]}\nprinciple: ") + principle);
      Simulation simulation(std::move(scene));
      for (int k = 1; k <= 50; ++k) {
        simulation.reset();
        for (int m = 0; m < 6; ++m) {
          simulation.advanceTo((k + m * period) * 1000000 / 1e9);
          simulation.command(0, std::sin(m + 1.0));
        }
        simulation.advanceTo((k + 10 * period) * 1000000 / 1e9);  // here nothing comes
        ASSERT_TRUE(simulation.status().ok())
            << k << " ms, period " << period << " ms: " << simulation.describeStatus();
        EXPECT_NEAR(simulation.sample().applied_torque[0], std::sin(6.0), 1e-12);
      }
    }
  }
}

TEST(CommandRhythm, ExpectsAThirdIntervalAfterTwoEqualOnes) {
  const double never = std::numeric_limits<double>::infinity();
  CommandRhythm rhythm;
  const auto next_after = [&](double time) {
    rhythm.note(time);
    return rhythm.next();
  };
  EXPECT_EQ(next_after(0.001), never);
  EXPECT_EQ(next_after(0.002), never);
  EXPECT_EQ(next_after(0.003), 0.004);
  EXPECT_EQ(next_after(0.003), 0.004);  // two inputs, one instant
  EXPECT_EQ(next_after(0.004), 0.005);
  EXPECT_EQ(next_after(0.0047), never);
  EXPECT_EQ(next_after(0.0054), 0.0061);
  EXPECT_EQ(next_after(0.0061 + 1e-13), never);  // no whole nanosecond
  EXPECT_EQ(next_after(0.0068), never);
  EXPECT_EQ(next_after(0.0075), never);
  EXPECT_EQ(next_after(0.0082), 0.0089);
  rhythm.reset();
  EXPECT_EQ(rhythm.next(), never);
  EXPECT_EQ(next_after(0.0089), never);
  // The very double that whole nanoseconds come at, over a day.
  for (std::int64_t n = 1; n < 86400000; n += 999983) {
    rhythm.reset();
    for (std::int64_t k = n; k < n + 3; ++k) rhythm.note(static_cast<double>(k * 1000000) / 1e9);
    ASSERT_EQ(rhythm.next(), static_cast<double>((n + 3) * 1000000) / 1e9) << n;
  }
  // No command is expected at times at which doubles are coarser than nanoseconds.
  rhythm.reset();
  EXPECT_EQ(next_after(1e7), never);
  EXPECT_EQ(next_after(1e7 + 1.0), never);
  EXPECT_EQ(next_after(1e7 + 2.0), never);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Skips, testing::ValuesIn(kScenes),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace variator_sim
