/// The steppers that the stress tests sweep over, and small helpers for scenes, references and
/// labels.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "stress/hazard.h"
#include "support/scenes.h"

namespace variator_sim::test {

/// All steppers that choose their steps themselves.
constexpr StepperKind kAdaptiveSteppers[] = {StepperKind::kAuto, StepperKind::kDopri5,
                                             StepperKind::kFehlberg78, StepperKind::kRadau,
                                             StepperKind::kTaylor};

/// Adaptive steppers that `scene` accepts.
inline std::vector<StepperKind> steppersOf(const Scene& scene) {
  std::vector<StepperKind> taken;
  for (StepperKind stepper : kAdaptiveSteppers) {
    if (takes(scene, stepper)) taken.push_back(stepper);
  }
  return taken;
}

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kEps = 2.2e-16;
inline constexpr const char* kPrinciples[] = {"generalized_gauss", "gauss"};

/// From the loosest one that is used to the tightest one that doubles allow.
inline std::vector<double> sweptTolerances() {
  return isLongForm() ? std::vector<double>{1e-3, 1e-5, 1e-7, 1e-9, 1e-11}
                      : std::vector<double>{1e-5, 1e-9};
}

inline Scene withSolver(Scene scene, StepperKind stepper, double tolerance) {
  return withTolerance(withStepper(std::move(scene), stepper), tolerance);
}

/// Limits the steps for scenes that need few in a second (but for the long form's 1,000 kinks in
/// one), so that a crawl is reported soon.
inline Scene withFewSteps(Scene scene) {
  scene.solver.maximum_steps = isLongForm() ? 200000 : 10000;
  return scene;
}

/// Nothing in `scene` has a reason to stop. Exceptions are those of doc/evidence.md: an implicit
/// stepper by name at an event, and rounding of the state alone under `gauss`.
inline void expectNoStop(const Run& run, const Scene& scene, const std::string& label) {
  const StepperKind stepper = scene.solver.stepper;
  const bool is_implicit = stepper == StepperKind::kRadau;
  const bool is_known =
      (is_implicit &&
       (run.reason == StopReason::kStepUnderflow || run.reason == StopReason::kStepLimit)) ||
      (scene.principle == Principle::kGauss && run.reason == StopReason::kToleranceTooSmall);
  if (is_known) return;
  EXPECT_EQ(run.reason, StopReason::kNone) << label << ": " << run.message;
}

inline std::string describe(StepperKind stepper, double tolerance) {
  return std::string(toString(stepper)) + " at " + text(tolerance);
}

/// A scene by one stepper at one tolerance.
struct Method {
  StepperKind stepper;
  double tolerance;
  std::string name;
  Scene scene;
};

/// `scene` by all that choose their steps, of those that it takes, at each of `tolerances`.
inline std::vector<Method> methodsOf(const Scene& scene, const std::vector<double>& tolerances) {
  std::vector<Method> methods;
  for (StepperKind stepper : steppersOf(scene)) {
    for (double tolerance : tolerances) {
      methods.push_back({stepper, tolerance, describe(stepper, tolerance),
                         withSolver(scene, stepper, tolerance)});
    }
  }
  return methods;
}

/// A number in full precision, in parentheses: for formulas.
inline std::string exactly(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "(%.17g)", value);
  return buffer;
}
/// The same without parentheses: for keys.
inline std::string plainly(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  return buffer;
}

/// A motion known at every instant: `write(t, sample)` fills velocities and accelerations.
template <class Write>
Run tabulate(const std::vector<double>& times, Write write) {
  Run run;
  for (double time : times) {
    Sample sample;
    sample.time = time;
    write(time, sample);
    run.samples.push_back(sample);
  }
  if (!times.empty()) run.end = times.back();
  return run;
}

/// The integral of f from a to b: `panels` times Gauss' rule of five points, good to rounding for
/// the smooth functions it is used on.
template <class Function>
double integrate(Function f, double a, double b, int panels = 64) {
  static constexpr double kPoints[] = {-0.90617984593866399280, -0.53846931010568309104, 0.0,
                                       0.53846931010568309104, 0.90617984593866399280};
  static constexpr double kWeights[] = {0.23692688505618908751, 0.47862867049936646804,
                                        0.56888888888888888889, 0.47862867049936646804,
                                        0.23692688505618908751};
  const double half = 0.5 * (b - a) / panels;
  double sum = 0.0;
  for (int panel = 0; panel < panels; ++panel) {
    const double middle = a + (2 * panel + 1) * half;
    for (int i = 0; i < 5; ++i) sum += kWeights[i] * f(middle + half * kPoints[i]);
  }
  return sum * half;
}

}  // namespace variator_sim::test
