// The stepper that steps by the series of the motion: what its error is, where it steps, and who
// takes over where there is no series.

#include <fstream>

#include "support/faults.h"
#include "support/scenes.h"
#include "variator_sim/torque.h"

namespace variator_sim {
namespace {

const std::string kBenchmark = std::string(VARIATOR_SIM_TEST_DIR) + "/../benchmark/";

/// The states at the end of the benchmark's smooth scenes, by methods of their own in long double.
std::map<std::string, std::vector<double>> readReferences() {
  std::map<std::string, std::vector<double>> references;
  std::ifstream file(kBenchmark + "references.csv");
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream row(line);
    std::string name;
    std::string cell;
    std::getline(row, name, ',');
    std::getline(row, cell, ',');  // the difference of two methods
    while (std::getline(row, cell, ',')) {
      if (name != "scene") references[name].push_back(std::stod(cell));
    }
  }
  return references;
}

struct Smooth {
  const char* name;
  double end;   ///< s
  double most;  ///< error in units of the tolerance
};
constexpr Smooth kSmooth[] = {{"ship", 20.0, 1.0},        {"smooth_linear", 20.0, 1.0},
                              {"four_shafts", 10.0, 1.0}, {"acceleration_circle", 5.0, 1.0},
                              {"crank", 2.0, 15.0},       {"order1", 20.0, 1.0},
                              {"order3", 20.0, 1.0}};

class SmoothScene : public ::testing::TestWithParam<Smooth> {
 protected:
  Scene scene(StepperKind stepper, double tolerance) const {
    const std::string file = kBenchmark + "scenes/" + GetParam().name + ".yaml";
    return test::withStepper(test::withTolerance(test::sceneFromFile(file), tolerance), stepper);
  }
};

/// The largest error at the end, in units of tolerance (1 + |x|).
double errorOf(const Sample& sample, const std::vector<double>& exact, double tolerance) {
  const std::size_t shafts = exact.size() / 3;
  double error = 0.0;
  const double* const parts[] = {sample.angle, sample.velocity, sample.acceleration};
  for (std::size_t n = 0; n < exact.size(); ++n) {
    const double difference = std::abs(parts[n / shafts][n % shafts] - exact[n]);
    error = std::max(error, difference / (tolerance * (1.0 + std::abs(exact[n]))));
  }
  return error;
}

TEST_P(SmoothScene, HasAnErrorNearTheTolerance) {
  const std::vector<double> exact = readReferences().at(GetParam().name);
  std::vector<double> errors;
  for (int digits = 3; digits <= 12; ++digits) {
    const double tolerance = std::pow(10.0, -digits);
    Simulation simulation(scene(StepperKind::kTaylor, tolerance));
    ASSERT_TRUE(simulation.advanceTo(GetParam().end).ok()) << simulation.describeStatus();
    const double error = errorOf(simulation.sample(), exact, tolerance);
    EXPECT_LT(error, GetParam().most) << tolerance;
    errors.push_back(error * tolerance);
    // By itself one may be small by accident, and none need be smaller than a few roundings.
    constexpr double kRounding = 1e-15;
    const std::size_t n = errors.size();
    if (n > 2 && errors[n - 1] > kRounding) {
      EXPECT_LT(errors[n - 1], errors[n - 3]) << tolerance;
    }
    EXPECT_LE(simulation.statistics().rejected_steps, 1u) << tolerance;
  }
}

// Steps of these are limited by singularities beside the real axis, which `radau` feels, too: each
// of its trials would cost as much as several steps.
TEST_P(SmoothScene, IsSteppedByNothingElse) {
  Simulation simulation(scene(StepperKind::kAuto, 1e-9));
  ASSERT_TRUE(simulation.advanceTo(GetParam().end).ok()) << simulation.describeStatus();
  const Statistics& counted = simulation.statistics();
  EXPECT_STREQ(simulation.stepperName(), "taylor");
  // One right-hand side at the end of each step, two at the start.
  EXPECT_LE(counted.right_hand_sides, counted.steps + counted.rejected_steps + 2);
}

INSTANTIATE_TEST_SUITE_P(Taylor, SmoothScene, ::testing::ValuesIn(kSmooth),
                         [](const auto& tested) { return std::string(tested.param.name); });

Scene oneShaft(const std::string& torque, StepperKind stepper, double tolerance = 1e-8) {
  return test::withStepper(
      test::withTolerance(test::sceneFromText("a 1", {std::string("m on a: ") + torque}),
                          tolerance),
      stepper);
}

/// Whether the series step somewhere up to `end`.
bool comesBack(Simulation& simulation, double end) {
  constexpr int kSamples = 100;
  const double begin = simulation.time();
  for (int n = 1; n <= kSamples; ++n) {
    simulation.advanceTo(begin + n * (end - begin) / kSamples);
    if (std::string(simulation.stepperName()) == "taylor") return true;
  }
  return false;
}

/// The velocity at `end` is that by fehlberg78 at 1e-10.
void expectMotionOfFehlberg78(Simulation& simulation, const std::string& torque, double end,
                              double tolerance) {
  Simulation exact(oneShaft(torque, StepperKind::kFehlberg78, 1e-10));
  ASSERT_TRUE(exact.advanceTo(end).ok()) << exact.describeStatus();
  ASSERT_TRUE(simulation.advanceTo(end).ok()) << torque << ": " << simulation.describeStatus();
  EXPECT_NEAR(simulation.sample().velocity[0], exact.sample().velocity[0], tolerance) << torque;
}

// Series at overflows, on kinks and at points of powers whose recurrence would divide by zero.
TEST(Taylor, StepsWhereAFormulaHasSeriesAllTheSame) {
  for (const char* torque :
       {"5/(1+exp(100*(w1-3)))-0.1*w1+20*cos(t)", "5-0.001*w1^20", "5*cos(t)-2*w1*abs(w1)",
        "5*cos(t)-2*w1*abs(w1)-0.5*w1^3/(0.01+w1^2)", "max(0, 4*sin(t))-w1", "3-tanh(50*w1)"}) {
    Simulation simulation(oneShaft(torque, StepperKind::kTaylor));
    expectMotionOfFehlberg78(simulation, torque, 7.0, 1e-5);
    EXPECT_STREQ(simulation.stepperName(), "taylor");
  }
}

// At rest no series exists of |w|^1.5: the event at the start leads to where one does, with a reach
// so short that another stepper takes over at once. At later stops none exists.
TEST(Taylor, IsLeftWhereThereIsNoSeriesAndComesBack) {
  const std::string torque = "5*cos(t)-3*abs(w1)^1.5*sign(w1)";
  Simulation simulation(oneShaft(torque, StepperKind::kAuto));
  EXPECT_STREQ(simulation.stepperName(), "taylor");
  ASSERT_TRUE(simulation.advanceTo(1e-6).ok());
  EXPECT_STRNE(simulation.stepperName(), "taylor");
  expectMotionOfFehlberg78(simulation, torque, 1.0, 1e-6);
  EXPECT_TRUE(comesBack(simulation, 5.0));
  EXPECT_GE(simulation.statistics().stepper_switches, 2u);
  expectMotionOfFehlberg78(simulation, torque, 10.0, 1e-6);
}

// The same of a motion that is not stiff there: some steps by radau, next to none in vain.
TEST(Taylor, IsLeftForAFewStepsWhereThereIsNoSeries) {
  const std::string torque = "5-0.001*w1^8.5";
  Simulation simulation(oneShaft(torque, StepperKind::kAuto));
  ASSERT_TRUE(simulation.advanceTo(1e-9).ok());
  EXPECT_STREQ(simulation.stepperName(), "radau");
  EXPECT_LE(simulation.statistics().rejected_steps, 1u);  // of the first size that is tried
  expectMotionOfFehlberg78(simulation, torque, 3.0, 1e-7);
  EXPECT_GE(simulation.statistics().stepper_switches, 2u);  // to series, and back near rest
  EXPECT_LE(simulation.statistics().implicit_steps, 30u);
}

// A branch without a series that the motion comes to with its fifth derivative only.
TEST(Taylor, LosesNothingWhereASeriesEndsLate) {
  const Scene scene =
      test::sceneFromText("a 1, b 1, c 1", {"m on a: t^3", "q on b: if(phi1 <= 0, 0, -sqrt(w2))"},
                          "principle: gauss\n"
                          "initial: {velocity: [0, 0, 7]}\n"
                          "verify_derivatives: false");
  for (StepperKind stepper : {StepperKind::kTaylor, StepperKind::kAuto}) {
    Simulation simulation(test::withStepper(scene, stepper));
    simulation.advanceTo(1.0);
    EXPECT_NEAR(simulation.sample().velocity[2], 7.0, 1e-8) << toString(stepper);
  }
}

// Step batches end at the requested time. The steps, their ends and their stops do not depend on
// it, nor do the samples of a step on the way.
TEST(Taylor, StepsMadeAheadAreThoseMadeOneByOne) {
  const std::string scenes = std::string(VARIATOR_SIM_TEST_DIR) + "/../benchmark/scenes/";
  const std::string bump =
      test::sceneText("a 1", {"q on a: -phi1 + exp(-(20*(w1-0.4))^2)"}, "initial: {velocity: [1]}");
  const std::string rest =
      test::sceneText("a 1", {"q on a: -w1 - 0.5*w1^2"}, "initial: {velocity: [1]}");
  const Scene cases[] = {test::sceneFromFile(scenes + "ship.yaml"),
                         test::sceneFromFile(scenes + "crank.yaml"),
                         test::sceneFromFile(scenes + "order3.yaml"),
                         test::sceneFromFile(scenes + "torque_steps.yaml"),
                         test::sceneFromText(bump),
                         test::sceneFromText(rest)};
  for (const Scene& scene : cases) {
    for (const int maximum_steps : {10000, 13}) {
      Scene limited = test::withTolerance(scene, 1e-7);
      limited.solver.maximum_steps = maximum_steps;
      limited.solver.maximum_step = 100.0;
      Simulation at_once(limited);
      Simulation cut(limited);
      Simulation tracked(limited);
      tracked.trackEnergy(true);
      constexpr double kEnd = 150.0;  // s
      at_once.advanceTo(kEnd);
      tracked.advanceTo(kEnd);
      for (int n = 1; n <= 997 && cut.status().ok(); ++n) cut.advanceTo(n * kEnd / 997.0);
      const Sample& sample = at_once.sample();
      for (Simulation* other : {&cut, &tracked}) {
        EXPECT_EQ(other->describeStatus(), at_once.describeStatus());
        EXPECT_EQ(other->time(), at_once.time());
        EXPECT_EQ(other->statistics().steps, at_once.statistics().steps);
        EXPECT_EQ(other->statistics().sleeps, at_once.statistics().sleeps);
        EXPECT_EQ(other->statistics().stepper_switches, at_once.statistics().stepper_switches);
        for (int i = 0; i < scene.shaftCount(); ++i) {
          EXPECT_EQ(other->sample().velocity[i], sample.velocity[i]) << i;
          EXPECT_EQ(other->sample().acceleration[i], sample.acceleration[i]) << i;
        }
      }
      EXPECT_EQ(cut.energy().applied, at_once.energy().applied);
    }
  }
}

// The end of an input's ramp moves the time origin, and with it the requested time in relative
// terms.
TEST(Taylor, StepsMadeAheadEndWhereTheyAreToBehindARamp) {
  const Scene scene = test::sceneFromText(
      "a 1", {"m on a from u, hold: first_order_hold, period: 0.4", "q on a: -60*sin(phi1)"},
      "initial: {velocity: [3]}");
  const auto play = [&](Scene given, StepperKind stepper) {
    given.solver.stepper = stepper;
    Simulation simulation(given);
    simulation.advanceTo(0.5);
    simulation.command(0, 2.0);
    simulation.advanceTo(1.2);
    return simulation.sample().velocity[0];
  };
  EXPECT_NEAR(play(test::withTolerance(scene, 1e-7), StepperKind::kTaylor),
              play(test::withTolerance(scene, 1e-11), StepperKind::kFehlberg78), 1e-5);
}

// Damped 1e5 times as much from 1 s to 3 s.
TEST(Taylor, IsLeftWhileTheMotionIsStiff) {
  const std::string torque = "-(1+5e4*(tanh(10*(t-1))-tanh(10*(t-3))))*(w1-cos(t))";
  Simulation simulation(oneShaft(torque, StepperKind::kAuto));
  ASSERT_TRUE(simulation.advanceTo(0.1).ok());
  EXPECT_STREQ(simulation.stepperName(), "taylor");
  expectMotionOfFehlberg78(simulation, torque, 2.5, 3e-6);
  EXPECT_STREQ(simulation.stepperName(), "radau");
  EXPECT_TRUE(comesBack(simulation, 80.0));
  expectMotionOfFehlberg78(simulation, torque, 80.0, 3e-6);
  EXPECT_LT(simulation.statistics().steps, 3000u);
}

class Drag : public OpaqueFunction {
 public:
  Drag() : OpaqueFunction(1) {}
  double value(const double* x) const override { return -0.1 * x[0]; }
  void calcGradient(const double* /*x*/, double* gradient) const override { gradient[0] = -0.1; }
};

/// A law without series.
class Opaque : public Torque {
  void build(LawContext& scene) override {
    const Shaft shaft = scene.shaftAt(0);
    scene.apply(shaft, scene.function(std::make_shared<Drag>(), {shaft.velocity}));
  }
};

TEST(Taylor, IsRefusedWhereTheMotionHasNoSeries) {
  for (StepperKind stepper : {StepperKind::kTaylor, StepperKind::kTaylorFixed}) {
    Scene opaque = oneShaft("1-w1", stepper);
    test::addTorque(opaque, std::make_shared<Opaque>());
    test::expectRefused("solver/stepper", {toString(stepper), "auto"},
                        [&] { Simulation simulation(opaque); });
    const Scene automatic = test::withStepper(opaque, StepperKind::kAuto);
    EXPECT_STREQ(Simulation(automatic).stepperName(), "radau");
  }
}

TEST(Taylor, OfFixedStepsKeepsThem) {
  Scene scene = oneShaft("5*cos(t)-w1", StepperKind::kTaylorFixed, 1e-8);
  scene.solver.step = 0.5;
  Simulation simulation(scene);
  double largest = 0.0;
  for (int n = 1; n <= 20; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.5 * n).ok());
    EXPECT_EQ(simulation.statistics().steps, static_cast<std::uint64_t>(n));
    largest = std::max(largest, simulation.statistics().largest_error_estimate);
  }
  EXPECT_GT(largest, 0.0);
  // w = 5 (cos t + sin t - exp(-t)) / 2
  const double exact = 2.5 * (std::cos(10.0) + std::sin(10.0) - std::exp(-10.0));
  EXPECT_NEAR(simulation.sample().velocity[0], exact, 1e-7);
}

}  // namespace
}  // namespace variator_sim
