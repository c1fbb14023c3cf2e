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

TEST(Taylor, SaysWhyItStopsWhereThereIsNoSeries) {
  Simulation simulation(oneShaft("5-w1^1.5", StepperKind::kTaylor));
  EXPECT_EQ(simulation.advanceTo(1.0).reason, StopReason::kStepUnderflow);
  EXPECT_NE(simulation.describeStatus().find("no power series here"), std::string::npos);
  EXPECT_NE(simulation.describeStatus().find("'solver/stepper: auto'"), std::string::npos);
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

// The derivatives of a function that is flat here do not show its values further along its
// argument: a swing through narrow bumps, of closed form but for an integral.
TEST(Taylor, MissesNoBumpInsideAStep) {
  struct Bump {
    const char* torque;  ///< N m, over w1
    double (*value)(double w);
  };
  const Bump bumps[] = {
      {"exp(-(20*(w1-0.4))^2)", [](double w) { return std::exp(-std::pow(20.0 * (w - 0.4), 2)); }},
      {"1/cosh(30*(w1+0.7))^2", [](double w) { return std::pow(std::cosh(30.0 * (w + 0.7)), -2); }},
      {"1/(1+(30*(w1-0.4))^4)",
       [](double w) { return 1.0 / (1.0 + std::pow(30.0 * (w - 0.4), 4)); }},
      {"(0.01+(w1+0.2)^2)^-3", [](double w) { return std::pow(0.01 + std::pow(w + 0.2, 2), -3); }},
      {"1+tanh(40*(w1-0.97))", [](double w) { return 1.0 + std::tanh(40.0 * (w - 0.97)); }},
      {"1/(1+exp(60*(0.98-w1)))",
       [](double w) { return 1.0 / (1.0 + std::exp(60.0 * (0.98 - w))); }},
  };
  constexpr double kEnd = 20.0;  // s
  for (const Bump& bump : bumps) {
    double impulse = 0.0;  // by Simpson's rule
    constexpr int kParts = 200000;
    for (int n = 0; n <= kParts; ++n) {
      const double weight = n == 0 || n == kParts ? 1.0 : n % 2 == 1 ? 4.0 : 2.0;
      impulse += weight * bump.value(std::cos(kEnd * n / kParts)) * kEnd / (3.0 * kParts);
    }
    Scene scene =
        test::sceneFromText("a 1, b 1", {"p on a: -phi1", "q on b: " + std::string(bump.torque)},
                            "initial: {velocity: [1, 0]}");
    for (const double tolerance : {1e-4, 1e-6, 1e-9, 1e-12}) {
      for (const StepperKind stepper : {StepperKind::kTaylor, StepperKind::kAuto}) {
        // Whole steps under one of them, steps piece by piece under the other.
        scene.principle =
            stepper == StepperKind::kTaylor ? Principle::kGeneralizedGauss : Principle::kGauss;
        Simulation simulation(test::withStepper(test::withTolerance(scene, tolerance), stepper));
        ASSERT_TRUE(simulation.advanceTo(kEnd).ok()) << bump.torque;
        EXPECT_NEAR(simulation.sample().velocity[1], impulse, 100.0 * tolerance * (1.0 + impulse))
            << bump.torque << ' ' << toString(stepper) << ' ' << tolerance;
      }
    }
  }
}

// Values at a step's ends and middle may cover the range of a function that is not resolved between
// them: two tanh that rise from -1 to 1 have a difference of 0 at all three, and a bump that comes
// back at both ends has its largest and least value there. Of time alone the impulse of
// tanh(z + 3) - tanh(z - 3) is 12 for each unit of z.
TEST(OtherSteppers, MissNoBumpBetweenValuesThatCoverItsRange) {
  const auto returning = [](double t) {
    return 1.0 - std::cos(2.0 / std::cosh(222.39 * std::sin(3.141592653589793 * t)));
  };
  double sum = 0.0;
  constexpr int kParts = 100000;  // of a period, by the rule of trapezoids
  for (int n = 0; n < kParts; ++n) sum += returning((n + 0.5) / kParts) / kParts;
  const struct {
    const char* torque;
    double impulse;  // in 10 s
  } bumps[] = {
      {"4*(tanh((t-2.4665)/2e-3+3)-tanh((t-2.4665)/2e-3-3))", 4.0 * 12.0 * 2e-3},
      {"4*(1-cos(2/cosh(222.39*sin(3.141592653589793*t))))", 4.0 * 10.0 * sum},
  };
  for (const auto& bump : bumps) {
    for (const char* const principle : {"gauss", "generalized_gauss"}) {
      const Scene scene = test::sceneFromText(
          "a 1", {"q on a: " + std::string(bump.torque)},
          std::string("principle: ") + principle + "\ninitial: {velocity: [1]}");
      for (const StepperKind stepper : {StepperKind::kDopri5, StepperKind::kFehlberg78,
                                        StepperKind::kRadau, StepperKind::kAuto}) {
        Simulation simulation(test::withStepper(test::withTolerance(scene, 1e-9), stepper));
        ASSERT_TRUE(simulation.advanceTo(10.0).ok()) << bump.torque;
        EXPECT_NEAR(simulation.sample().velocity[0], 1.0 + bump.impulse, 1e-6)
            << bump.torque << ' ' << principle << ' ' << toString(stepper);
      }
    }
  }
}

// A motion that starts on the top of a bump of Q(omega), where the linearization is stiff, leaves
// it at once: omega' = 1 + 800 exp(-((omega - 1)/1e-3)^2) is 1 behind it.
TEST(OtherSteppers, LeaveTheTopOfABump) {
  for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6}) {
    for (const double width : {1e-2, 1e-3, 3e-4, 1e-4}) {
      const Scene scene = test::sceneFromText(
          "a 1", {"q on a: 1+800*exp(-((w1-1)/" + std::to_string(width) + ")^2)"},
          "initial: {velocity: [1]}");
      for (const StepperKind stepper : {StepperKind::kRadau, StepperKind::kAuto}) {
        Simulation simulation(test::withStepper(test::withTolerance(scene, tolerance), stepper));
        ASSERT_TRUE(simulation.advanceTo(1.0).ok());
        // omega has risen by a few widths at once
        EXPECT_NEAR(simulation.sample().velocity[0], 2.0, 4.0 * width + 100.0 * tolerance)
            << tolerance << ' ' << width << ' ' << toString(stepper);
      }
    }
  }
}

// A bump that is no more than the pulse between two edges in time begins with nothing, and its
// steps are shorter than those before: its end is no event that rejected steps have met. The
// impulse of (1 - z^2)^5 for |z| < 1 is 512/693 for each unit of z, 2 of them.
TEST(OtherSteppers, MissNoBumpBetweenEdges) {
  const Scene scene = test::sceneFromText(
      "a 1", {"q on a: 2e5*if(((t-1.402)/5e-6)^2<1,(1-((t-1.402)/5e-6)^2)^5,0)"},
      "initial: {velocity: [1]}");
  for (const double tolerance : {1e-5, 1e-8, 1e-11}) {
    for (const StepperKind stepper : {StepperKind::kTaylor, StepperKind::kDopri5,
                                      StepperKind::kFehlberg78, StepperKind::kRadau}) {
      Simulation simulation(test::withStepper(test::withTolerance(scene, tolerance), stepper));
      ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << toString(stepper);
      EXPECT_NEAR(simulation.sample().velocity[0], 1.0 + 2e5 * 5e-6 * 512.0 / 693.0,
                  1e-8 + 10.0 * tolerance)
          << tolerance << ' ' << toString(stepper);
    }
  }
}

// Bumps of a width h, far narrower than any step that does not know of them, wherever in a step
// they come: an argument that turns in the last eighth of one, or at a value that no double of its
// size tells from others; 1/cosh of an argument that passes 0 without turning, and is infinite on
// either side; and again and again. J w' = 1 + 20 b((w - 1.3)/h) takes the less time for a change
// of w, as b(z) is more; of time itself bumps of 1/h have the impulse of b.
TEST(Taylor, MissesNoBumpHoweverNarrow) {
  struct Bump {
    const char* of;  ///< %: the argument
    double (*value)(double z);
  };
  const Bump bumps[] = {
      {"exp(-%^2)", [](double z) { return std::exp(-z * z); }},
      {"exp(-%^4)", [](double z) { return std::exp(-std::pow(z, 4)); }},
      {"1/cosh(%)^2", [](double z) { return std::pow(std::cosh(z), -2); }},
      {"1/(1+%^4)", [](double z) { return 1.0 / (1.0 + std::pow(z, 4)); }},
  };
  // Simpson's rule on z = x / (1 - x^2)
  const auto integrate = [](const auto& f) {
    constexpr int kParts = 20000;
    double sum = 0.0;
    for (int n = 1; n < kParts; ++n) {
      const double x = -1.0 + 2.0 * n / kParts;
      const double left = 1.0 - x * x;
      sum += (n % 2 == 1 ? 4.0 : 2.0) * f(x / left) * (1.0 + x * x) / (left * left);
    }
    return sum * 2.0 / (3.0 * kParts);
  };
  const auto play = [](const Bump& bump, const std::string& argument, const std::string& before,
                       const std::string& velocity) {
    std::string law = bump.of;
    law.replace(law.find('%'), 1, "(" + argument + ")");
    Scene scene = test::sceneFromText("a 1.5", {std::string("m on a: ") + before + law},
                                      std::string("initial: {velocity: [") + velocity + "]}");
    Simulation simulation(
        test::withStepper(test::withTolerance(scene, 1e-9), StepperKind::kTaylor));
    EXPECT_TRUE(simulation.advanceTo(4.0).ok()) << law << ' ' << simulation.describeStatus();
    return simulation.sample().velocity[0];
  };
  for (const Bump& bump : bumps) {
    const double saved =
        integrate([&](double z) { return 1.0 - 1.0 / (1.0 + 20.0 * bump.value(z)); });
    const double impulse = integrate(bump.value);
    for (const char* const h : {"1e-2", "1e-3", "1e-4", "1e-5", "1e-6"}) {
      const std::string over = std::string(")/") + h;
      const double width = std::stod(h);
      EXPECT_NEAR(play(bump, "(w1-1.3" + over, "1+20*", "0"), 4.0 / 1.5 + width * saved, 1e-7)
          << bump.of << ' ' << h;
      const std::string strong = std::string("1/") + h + "*";
      const double beyond = width * width * width;  // of 1/(1 + z^4), before 0 and after 4 s
      EXPECT_NEAR(play(bump, "(t-1.3" + over, strong, "1"), 1.0 + impulse / 1.5, 1e-7 + beyond)
          << bump.of << ' ' << h;
      if (width < 1e-4) continue;
      // At 0, where half of it is, pi/3, 2 pi/3 and pi, each a third as wide.
      EXPECT_NEAR(play(bump, "(sin(3*t)" + over, strong, "1"), 1.0 + 3.5 / 3.0 * impulse / 1.5,
                  std::max(1e-7, width * width))
          << bump.of << ' ' << h;
    }
  }
}

// cosh and cos have a slope of 0 where their argument is 0: all that they do later is of its
// square, which the first terms of a series do not show. The step is made anew to a command, and
// jerks that are given have nothing beside them that tells.
TEST(Taylor, CutsNoSeriesShortBeforeTheSquareOfAnArgument) {
  // j2 = sum_{m > 0} (+-1)^m (3 t)^2pm / (2m)!
  const auto calcVelocity = [](double t, int p, double sign) {
    double sum = 0.0;
    double term = t * t;
    for (int m = 1; m < 20; ++m) {
      term *= sign * std::pow(3.0 * t, 2 * p) / (2.0 * m * (2.0 * m - 1.0));
      sum += term / ((2.0 * p * m + 1.0) * (2.0 * p * m + 2.0));
    }
    return sum;
  };
  for (const std::string function : {"cosh", "cos"}) {
    for (const int power : {2, 3}) {
      const std::string bump = function + "((3*t)^" + std::to_string(power) + ")-1";
      Scene scene = test::sceneFromText(
          "shafts: [a, b]\na: {inertia: 1}\nb: {inertia: 1}\ntorques: [m]\n"
          "m: {type: variator_sim/CommandedTorque, shaft: a, topic: u}\nconstraints: [k]\n"
          "k: {type: variator_sim/ExpressionConstraint, order: 3, expression: \"j2-(" +
          bump + ")\"}\n");
      Simulation simulation(
          test::withStepper(test::withTolerance(scene, 1e-11), StepperKind::kTaylor));
      simulation.advanceTo(0.1);
      simulation.command(0, 1.0);
      ASSERT_TRUE(simulation.advanceTo(0.5).ok()) << simulation.describeStatus();
      EXPECT_NEAR(simulation.sample().velocity[1],
                  calcVelocity(0.5, power, function == "cosh" ? 1.0 : -1.0), 1e-10)
          << bump;
    }
  }
}

// A torque that turns over within a layer is in few coefficients before it, and behind it in none:
// the accelerations are those of before but for what Q tells. On e1^2 + e2^2 = 4, e = 2 (cos a, sin
// a), they depend on Q alone (theory.md): tan(a/2) = tan(a_0/2) exp(-(Q - Q_0)/(2 J)).
TEST(Taylor, WholeStepsSeeATorqueThatTurnsOverInALayer) {
  for (const double k : {1e3, 1e5, 1e7}) {
    const Scene scene = test::sceneFromText(
        "a 1.5, b 1.5",
        {"m on a: atan(" + std::to_string(k) + "*(t-1.3))+2*sin(2*t)", "c: e1^2+e2^2-4"},
        "initial: {acceleration: [1.2, 1.6]}");
    const double gained = std::atan(k * 0.7) - std::atan(-k * 1.3) + 2.0 * std::sin(4.0);
    const double angle = 2.0 * std::atan(0.5 * std::exp(-gained / 3.0));
    for (const double tolerance : {1e-3, 1e-6, 1e-9}) {
      Simulation simulation(
          test::withStepper(test::withTolerance(scene, tolerance), StepperKind::kTaylor));
      ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << simulation.describeStatus();
      const Sample& sample = simulation.sample();
      EXPECT_NEAR(sample.acceleration[0], 2.0 * std::cos(angle), 100.0 * tolerance)
          << k << ' ' << tolerance;
      EXPECT_NEAR(sample.acceleration[1], 2.0 * std::sin(angle), 100.0 * tolerance)
          << k << ' ' << tolerance;
    }
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
