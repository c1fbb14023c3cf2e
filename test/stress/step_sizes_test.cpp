/// The extremes of step sizes: tolerances from 1e-3 to 1e-13, no absolute tolerance, fixed steps
/// far too large, and times so late that t + h loses digits.
#include "stress/methods.h"

namespace variator_sim::test {
namespace {

constexpr StepperKind kFixedSteppers[] = {StepperKind::kRk4, StepperKind::kTaylorFixed};

/// Scenes with exact motions.
struct Known {
  std::string name;
  std::string yaml;  ///< without principle
  void (*write)(double t, Sample& sample);
  bool both_principles;
  double end;
};

/// The gear's response to cos 2t - 0.4 w1 from rest.
void writeDrivenGear(double t, Sample& sample) {
  const double J = gearInertia(1);
  const double c = 0.4 / J;
  // w' = cos(2t)/J - c w
  const double scale = 1.0 / J / (c * c + 4.0);
  const double w = scale * (c * std::cos(2.0 * t) + 2.0 * std::sin(2.0 * t) - c * std::exp(-c * t));
  sample.velocity[0] = w;
  sample.acceleration[0] = std::cos(2.0 * t) / J - c * w;
  writeGear(1, sample);
}

/// The acceleration circle: J = 1.5, a = 2, torque 1.2 t on shaft 1 (generalized_gauss only).
void writeCircle(double t, Sample& sample) {
  const double a = 2.0;
  const double kappa = 1.2 / (a * 1.5);
  const double z0 = std::atanh(-0.5);
  const double z = kappa * t + z0;
  const auto gd = [](double x) { return 2.0 * std::atan(std::tanh(0.5 * x)); };
  sample.acceleration[0] = a * std::tanh(z);
  sample.acceleration[1] = a / std::cosh(z);
  sample.velocity[0] = a / kappa * (std::log(std::cosh(z)) - std::log(std::cosh(z0)));
  sample.velocity[1] = a / kappa * (gd(z) - gd(z0));
}

const std::string kCircle = sceneText("a 1.5, b 1.5", {"q on a: 1.2*t", "k: e1^2+e2^2-4"},
                                      "initial: {acceleration: [-1, 1.7320508075688772]}");

/// Slip that relaxes with tau = 0.05 and no torques: w2 - 0.6 w1 = exp(-t/tau).
void writeSlip(double t, Sample& sample) {
  const double tau = 0.05;
  const double A = 0.36 / 1.5 + 1.0 / 0.8;
  const double slip = std::exp(-t / tau);
  const double lambda = (slip - 1.0) / A;
  sample.velocity[0] = 1.0 - 0.6 / 1.5 * lambda;
  sample.velocity[1] = 1.6 + lambda / 0.8;
  sample.acceleration[0] = 0.6 / 1.5 * slip / tau / A;
  sample.acceleration[1] = -slip / tau / A / 0.8;
}

const std::string kSlip =
    sceneText("a 1.5, b 0.8", {"k: 0.05*(e2-0.6*e1)+w2-0.6*w1"}, "initial: {velocity: [1, 1.6]}");

std::vector<Known> knownMotions() {
  // from rest, with the acceleration of the gear: an order 3 does not bind it by itself
  const auto gear = [](int order) {
    return Known{"gear of order " + std::to_string(order),
                 gearText(order, {"q on a: cos(2*t)-0.4*w1"}, 0.0, 1.0 / 1.7), writeDrivenGear,
                 true, 4.0};
  };
  return {gear(1),
          gear(2),
          gear(3),
          {"acceleration circle", kCircle, writeCircle, false, 4.0},
          {"slip", kSlip, writeSlip, true, 2.0}};
}

/// Rounding: 100 units of it are always allowed, plus one for each step.
double roundingOf(const test::Run& run, double tolerance) {
  return 2.2e-16 * (100.0 + static_cast<double>(run.statistics.steps)) / tolerance;
}

/// The known motions by every method; `change` may change the solver.
void compareKnown(Hazard& hazard, const std::vector<double>& tolerances,
                  void (*change)(SolverSettings&)) {
  for (const Known& known : knownMotions()) {
    for (const char* principle : kPrinciples) {
      if (!known.both_principles && principle != kPrinciples[0]) continue;
      const Scene plain = sceneFromText(known.yaml + "principle: " + principle + "\n");
      const std::vector<double> times = evenly(known.end, 9);
      const test::Run exact = tabulate(times, known.write);
      for (const Method& method : methodsOf(plain, tolerances)) {
        Scene scene = method.scene;
        change(scene.solver);
        const test::Run run = play(scene, times);
        // Accelerations of slip are velocities over tau under gauss: 20 times their rounding.
        hazard.compare(run, exact, scene, known.name + " " + principle + " " + method.name,
                       kAllowed + 20.0 * roundingOf(run, method.tolerance));
      }
    }
  }
}

TEST(StepSizes, Tolerances) {
  Hazard hazard("step sizes", "tolerances", "1e-1 to 1e-14");
  std::vector<double> tolerances = {1e-1, 1e-3, 1e-6, 1e-9, 1e-11, 1e-13, 1e-14};
  if (isLongForm()) {
    tolerances.clear();
    for (int n = 2; n <= 28; ++n) tolerances.push_back(std::pow(10.0, -0.5 * n));
  }
  compareKnown(hazard, tolerances, [](SolverSettings&) {});
}

/// The tolerance is relative alone: values that start from zero, pass through it, or stay there.
TEST(StepSizes, NoAbsoluteTolerance) {
  Hazard hazard("step sizes", "absolute tolerance 0", "relative 1e-3 to 1e-12");
  const std::vector<double> tolerances =
      isLongForm()
          ? std::vector<double>{1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12}
          : std::vector<double>{1e-3, 1e-6, 1e-9};
  // calcDifference measures in the largest value of the column so far; the angles do not count.
  compareKnown(hazard, tolerances, [](SolverSettings& solver) {
    solver.absolute_tolerance = 0.0;
    solver.maximum_steps = 100000;
  });
}

/// Fixed steps from fine to absurd. They have no error control, so this is the rule: the motion is
/// right, or it stops by name (StepTooLarge), or statistics().largest_error_estimate tells: the
/// error at the end is at most kTold times the estimate of the worst step times the number of
/// steps. rk4 has no estimate of its own but what its end tells (Stepper::estimateFromEnd).
TEST(StepSizes, FixedSteps) {
  constexpr double kTold = 10.0;
  Hazard hazard("step sizes", "fixed steps", "1e-3 to 10 s");
  const std::vector<double> steps =
      isLongForm() ? std::vector<double>{1e-3, 3e-3, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2,
                                         0.3,  0.5,  0.7,  1,    2,    5,   10}
                   : std::vector<double>{0.003, 0.03, 0.1, 0.13, 0.3, 0.7, 1, 4};
  struct Case {
    Known known;
    /// Steps beyond this, s, are left out: a torque of t that is sampled less than twice a period
    /// cannot be told from a slow one by any method.
    double longest;
  };
  std::vector<Case> cases;
  for (const Known& known : knownMotions()) cases.push_back({known, 1e9});
  // An oscillator: J w' = -k phi, 7 rad/s, with rest as the other solution of a damping scheme.
  cases.push_back(
      {{"oscillator", sceneText("a 1", {"q on a: -49*phi1"}, "initial: {velocity: [1]}"),
        [](double t, Sample& sample) {
          sample.velocity[0] = std::cos(7.0 * t);
          sample.acceleration[0] = -7.0 * std::sin(7.0 * t);
        },
        true, 4.0},
       1e9});
  // A torque that swings faster than the steps: 30 rad/s.
  cases.push_back({{"fast torque", sceneText("a 1", {"q on a: 30*cos(30*t)"}),
                    [](double t, Sample& sample) {
                      sample.velocity[0] = std::sin(30.0 * t);
                      sample.acceleration[0] = 30.0 * std::cos(30.0 * t);
                    },
                    true, 4.0},
                   0.2});
  for (const Case& each : cases) {
    const Known& known = each.known;
    for (const char* principle : kPrinciples) {
      if (!known.both_principles && principle != kPrinciples[0]) continue;
      const Scene plain = sceneFromText(known.yaml + "principle: " + principle + "\n");
      for (StepperKind stepper : kFixedSteppers) {
        for (double h : steps) {
          Scene scene = withSolver(plain, stepper, 1e-6);
          scene.solver.step = h;
          if (h > each.longest) continue;
          const double end = std::max(known.end, 2.0 * h);
          // Ends of steps; and the start, as errors are measured in the largest value so far.
          std::vector<double> times = {0.0};
          const int count = static_cast<int>(end / h);
          for (int i = 1; i <= 8; ++i) times.push_back(h * std::max(1, count * i / 8));
          times.erase(std::unique(times.begin(), times.end()), times.end());
          const test::Run run = play(scene, times);
          const test::Run exact = tabulate(times, known.write);
          const std::string label =
              known.name + " " + principle + " " + toString(stepper) + ", step " + text(h);
          const double estimate =
              run.statistics.largest_error_estimate *
              static_cast<double>(std::max<std::uint64_t>(1, run.statistics.steps));
          hazard.compare(run, exact, scene, label + ", estimate " + text(estimate),
                         kAllowed + kTold * estimate);
        }
      }
    }
  }
}

/// Late times: a scene that has rested until T (its torque begins at T by a ramp in a formula of
/// t - T) moves from there as from 0, within what T + x = T + x (1 + 1e-16 T/x) leaves of x.
TEST(StepSizes, LateTimes) {
  Hazard hazard("step sizes", "late times", "t from 0.5 to 1e9 s");
  std::vector<double> instants = {0.5, 1e3, 1e6, 1e9};
  if (isLongForm()) instants = {0.5, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
  const double J = gearInertia(1);
  const double c = 0.4 / J;
  for (double T : instants) {
    std::vector<double> times;
    for (double x : evenly(4.0, 8)) times.push_back(T + x);
    // J w' = u - 0.4 w with a command u = 1 at T
    const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
      const double w = -std::expm1(-c * (t - T)) / 0.4;
      sample.velocity[0] = w;
      sample.acceleration[0] = 1.0 / J - c * w;
      writeGear(1, sample);
    });
    for (const char* principle : kPrinciples) {
      for (int order = 1; order <= 3; ++order) {
        const Scene plain = sceneFromText(gearText(order, {"q on a: -0.4*w1", "m on a from m"}) +
                                          "principle: " + principle);
        Asked asked;
        asked.tolerances = {1e-4, 1e-8};
        asked.commands = {{T, 0, 1.0}};
        // A rest sleeps, so 1e9 s take no time.
        compareMethods(
            hazard, plain, exact,
            "T = " + text(T) + " " + principle + " order " + std::to_string(order), asked,
            [&](double tolerance) { return kAllowed + 10.0 * 4.0 * 1.2e-16 * T / tolerance; });
      }
    }
  }
}

/// The same with an explicit time: a torque cos 2(t - T) tanh-switched on at T, behind a long rest
/// of long steps, whose instants t + h and stages t + c h lose digits. (The stage's times are known
/// to 1e-16 T, the torque to that times its rate.)
TEST(StepSizes, LateTimesInFormulas) {
  Hazard hazard("step sizes", "late times in formulas of t",
                "t from 0 to 1e5 s, 1e7 in the long form");
  std::vector<double> instants = {0.0, 1e3, 1e5};
  if (isLongForm()) instants = {0.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7};
  for (double T : instants) {
    // On at T: a kink, max(0, t - T)^3, then a sine.
    std::vector<double> times;
    for (double x : evenly(4.0, 8)) times.push_back(T + x);
    // J e = y^3/(1 + y^3), y = max(0, t - T)
    const double J = 1.5;
    const auto e = [&](double y) { return y * y * y / (1.0 + y * y * y) / J; };
    const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
      sample.acceleration[0] = e(t - T);
      sample.velocity[0] = integrate(e, 0.0, t - T);
    });
    const std::string y = "max(0,t-" + exactly(T) + ")";
    for (const char* principle : kPrinciples) {
      Scene scene = sceneFromText("a 1.5", {"q on a: " + y + "^3/(1+" + y + "^3)"},
                                  std::string("principle: ") + principle);
      scene.solver.maximum_step = std::max(1.0, 1e-4 * T);
      compareMethods(hazard, scene, exact, "T = " + text(T) + " " + principle, {{1e-4, 1e-8}},
                     [&](double tolerance) { return kAllowed + 10.0 * 4.8e-16 * T / tolerance; });
    }
  }
}

/// Fixed steps at late times: T + n h is counted and not added up; what t + h - t loses is the
/// program's to bear.
TEST(StepSizes, FixedStepsAtLateTimes) {
  Hazard hazard("step sizes", "fixed steps at late times", "t up to 1e4 s (1e6 in the long form)");
  const double T = sizeOf(2e3, 1e5);
  // A torque 1 + sin t on a shaft with damping: periodic after a while.
  const Scene plain = sceneFromText("a 1.5", {"q on a: sin(t)-1.5*w1"});
  const std::vector<double> times = {1.0, 10.0, 100.0, T};
  const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
    // w' = sin(t)/J - w
    sample.velocity[0] = 0.5 / 1.5 * (std::sin(t) - std::cos(t) + std::exp(-t));
    sample.acceleration[0] = std::sin(t) / 1.5 - sample.velocity[0];
  });
  for (StepperKind stepper : kFixedSteppers) {
    for (double h : {0.01, 0.05}) {
      Scene scene = withSolver(plain, stepper, 1e-6);
      scene.solver.step = h;
      const test::Run run = play(scene, times);
      hazard.compare(run, exact, scene, std::string(toString(stepper)) + ", step " + text(h));
      EXPECT_EQ(run.reason, StopReason::kNone) << run.message;
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
