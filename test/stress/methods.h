/// The steppers that the stress tests sweep over, and small helpers for scenes, references and
/// labels.
#pragma once

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
  return "(" + plainly(value) + ")";
}

/// The line of a constraint behind its name: in `formula` _ stands for the variables of `order`,
/// w, e or j.
inline std::string ofOrder(int order, const std::string& formula) {
  std::string line = " of order " + std::to_string(order) + ": ";
  for (const char letter : formula) line += letter == '_' ? "?wej"[order] : letter;
  return line;
}

/// Shaft a of 1.5 kg m^2 with the lines of `torques`, alone (order 0) or with a gear of ratio 1/2,
/// of that order, to shaft b of 0.8 kg m^2.
inline std::string gearText(int order, std::vector<std::string> torques, double velocity = 0.0,
                            double acceleration = 0.0, double angle = 0.0) {
  if (order == 0) {
    return sceneText("a 1.5", torques,
                     "initial: {angle: " + list({angle}) + ", velocity: " + list({velocity}) + "}");
  }
  torques.push_back("k" + ofOrder(order, "_2-0.5*_1"));
  return sceneText("a 1.5, b 0.8", torques,
                   "initial: {angle: " + list({angle, 0.0}) +
                       ", velocity: " + list({velocity, 0.5 * velocity}) +
                       ", acceleration: " + list({acceleration, 0.5 * acceleration}) + "}");
}
/// What moves with shaft a, kg m^2.
inline double gearInertia(int order) {
  return order == 0 ? 1.5 : 1.5 + 0.25 * 0.8;
}
/// The motion of shaft b by that of shaft a.
inline void writeGear(int order, Sample& sample) {
  if (order == 0) return;
  sample.velocity[1] = 0.5 * sample.velocity[0];
  sample.acceleration[1] = 0.5 * sample.acceleration[0];
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

/// The stops that a comparison takes for right: those of expectNoStop, or all that have a name.
enum class Stops { kNone, kKnown, kAny };

/// How a scene is played by all methods.
struct Asked {
  std::vector<double> tolerances = sweptTolerances();
  Stops stops = Stops::kNone;
  Columns columns = Columns::kVelocityAndAcceleration;
  std::vector<TimedCommand> commands = {};
};

/// `scene` by all methods against `exact`, at its instants. `allowed` is a function of the
/// tolerance, in tolerances.
inline void compareMethods(Hazard& hazard, const Scene& scene, const Run& exact,
                           const std::string& label, const Asked& asked,
                           const std::function<double(double)>& allowed) {
  std::vector<double> times;
  for (const Sample& sample : exact.samples) times.push_back(sample.time);
  for (const Method& method : methodsOf(scene, asked.tolerances)) {
    const Run run = play(method.scene, times, asked.commands);
    const std::string full = label + ", " + method.name;
    hazard.compare(run, exact, method.scene, full, allowed(method.tolerance), asked.columns);
    if (asked.stops == Stops::kNone) {
      EXPECT_EQ(run.reason, StopReason::kNone) << full << ": " << run.message;
    }
    if (asked.stops == Stops::kKnown) expectNoStop(run, method.scene, full);
  }
}
inline void compareMethods(Hazard& hazard, const Scene& scene, const Run& exact,
                           const std::string& label, const Asked& asked = {},
                           double allowed = kAllowed) {
  compareMethods(hazard, scene, exact, label, asked, [=](double) { return allowed; });
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
