// Drift over long times: up to 1e6 simulated seconds. Residuals stay at round-off, invariants and
// energy as long as their theory says, and errors grow no faster than theory has them grow.
//
// Theory: every step adds an error of about a tolerance, and about one step is made per radian or
// second here. The motion decides how these errors grow:
// - where it is restored, they die away: no growth;
// - of an amplitude or a phase that nothing restores, and of an energy: they add up like t;
// - of the phase of a motion that keeps its own speed, from errors of the speed that add up: t^2;
//   from errors of a power that add up, of the energy like t^2: t^3.

#include "stress/known_motion.h"

namespace variator_sim::test {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// Growth over `radians` of a motion (about a step each) by the given power. The allowance of any
/// motion, kAllowed, covers ten radians.
double growth(double radians, int power) {
  return std::pow(std::max(1.0, 0.1 * radians), power);
}

/// 10, 100, ... `end`.
std::vector<double> decades(double end) {
  std::vector<double> times;
  for (double time = 10.0; time < 0.99 * end; time *= 10.0) times.push_back(time);
  times.push_back(end);
  return times;
}

std::vector<double> tolerances() {
  return isLongForm() ? std::vector<double>{1e-5, 1e-8, 1e-11} : std::vector<double>{1e-6, 1e-9};
}

/// A run as it goes: stopped by name, or judged at each sample by `judge(sample, label)`.
template <class Judge>
void judgeAlong(Hazard& hazard, const Scene& scene, const std::vector<double>& times,
                const std::string& label, Judge judge) {
  const test::Run run = play(scene, times);
  for (const Sample& sample : run.samples) {
    judge(sample, label + ", t = " + text(sample.time));
  }
  if (run.reason != StopReason::kNone) hazard.stopped(run.reason, label);
}

// --- a circle for ever ------------------------------------------------------------------------
/// No torque, and a constraint that says that the kinetic energy is constant, as order 1, 2 or 3.
/// With x_i = sqrt(J_i) w_i that is |x| = rho, and the reaction's rate is along x: x goes round at
/// the speed that it has.
struct Circle {
  int order = 2;
  static constexpr double kJ[2] = {0.8, 2.0};
  static constexpr double kRadius = 3.0;
  static constexpr double kSpeed = 1.0;
  static constexpr double kPhase = 0.3;

  std::string yaml() const {
    const Sample start = at(0.0);
    const auto list = [](const double* x) {
      return "[" + plainly(x[0]) + ", " + plainly(x[1]) + "]";
    };
    return "shafts: [a, b]\na: {inertia: 0.8}\nb: {inertia: 2.0}\ntorques: []\nconstraints: [p]\n"
           "p: {type: variator_sim/ExpressionConstraint, order: " +
           std::to_string(order) + ", expression: \"" +
           (order == 1   ? "0.8*w1^2+2*w2^2-9"
            : order == 2 ? "0.8*w1*e1+2*w2*e2"
                         : "0.8*w1*j1+2*w2*j2+0.8*e1^2+2*e2^2") +
           "\"}\ninitial: {angle: " + list(start.angle) + ", velocity: " + list(start.velocity) +
           ", acceleration: " + list(start.acceleration) + ", project: true}\n";
  }
  Sample at(double t) const {
    Sample sample;
    sample.time = t;
    const double angle = kSpeed * t + kPhase;
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const double unit[2] = {kRadius / std::sqrt(kJ[0]), kRadius / std::sqrt(kJ[1])};
    sample.angle[0] = unit[0] * s / kSpeed;
    sample.angle[1] = -unit[1] * c / kSpeed;
    sample.velocity[0] = unit[0] * c;
    sample.velocity[1] = unit[1] * s;
    sample.acceleration[0] = -unit[0] * s * kSpeed;
    sample.acceleration[1] = unit[1] * c * kSpeed;
    return sample;
  }
  static double calcEnergy(const Sample& s) {
    return 0.5 * (kJ[0] * s.velocity[0] * s.velocity[0] + kJ[1] * s.velocity[1] * s.velocity[1]);
  }
  /// dT/dt
  static double calcPower(const Sample& s) {
    return kJ[0] * s.velocity[0] * s.acceleration[0] + kJ[1] * s.velocity[1] * s.acceleration[1];
  }
};

TEST(Drift, OfAMotionThatGoesRoundForEver) {
  Hazard motion("drift", "uniform motion, error against t^2 (t^3: order 3)", "10 .. 1e6 s");
  Hazard energy("drift", "kinetic energy, error against t (t^2: order 3)", "10 .. 1e6 s");
  Hazard power("drift", "power of order 3, error against t", "10 .. 1e4 s");
  Hazard residual("drift", "residual, in 64 roundings", "10 .. 1e6 s");
  for (int order : {1, 2, 3}) {
    const Circle circle{order};
    const Scene scene = sceneFromText(circle.yaml());
    for (const Method& method : methodsOf(scene, tolerances())) {
      // one tolerance of each method for 1e6 s, the others for a part of it
      const bool is_slow = method.tolerance < 1e-8 && method.stepper == StepperKind::kDopri5;
      const double longest = order == 2 && method.tolerance == 1e-8 ? 1e6 : 1e4;
      const double end = sizeOf(is_slow ? 100.0 : 1000.0, longest);
      judgeAlong(
          motion, method.scene, decades(end), "order " + std::to_string(order) + ", " + method.name,
          [&](const Sample& sample, const std::string& label) {
            const double t = sample.time;
            test::Run run;
            run.samples = {sample};
            test::Run exact;
            exact.samples = {circle.at(t)};
            // psi of order 3 is T'' = 0, and holds neither T' nor T: errors of T' add up
            // like t, of T and so of the radius rho like t^2. The phase has the speed
            // h / rho^2, h = |x| |eps_t| being kept by R' along x: t^3.
            motion.judge(calcDifference(run, exact, 2, method.tolerance, method.tolerance), label,
                         kAllowed * growth(t, order == 3 ? 3 : 2));
            const double start = Circle::calcEnergy(circle.at(0.0));
            if (order == 3) {
              power.judge(std::abs(Circle::calcPower(sample)) / (2.0 * start * method.tolerance),
                          label, kAllowed * growth(t, 1));
            }
            energy.judge(std::abs(Circle::calcEnergy(sample) - start) / (start * method.tolerance),
                         label, kAllowed * growth(t, order == 3 ? 2 : 1));
            // For order 3, C eta + c0 = 0 is solved anew for each sample.
            residual.judge(std::abs(sample.residual[0]) / (9.0 * kEpsilon), label, 64.0);
          });
    }
  }
}

/// psi = J1 w1 e1 + J2 w2 e2 - P cos t: the energy is T(0) + P sin t whatever the torques.
TEST(Drift, OfAnEnergyThatIsPrescribed) {
  Hazard energy("drift", "energy T(0) + integral of P, error against t", "10 .. 1e5 s");
  Hazard residual("drift", "residual of a power constraint, in 64 roundings", "10 .. 1e5 s");
  for (int order : {1, 2}) {
    const Scene scene = sceneFromText(
        "shafts: [a, b]\na: {inertia: 0.8}\nb: {inertia: 2.0}\ntorques: [q]\n"
        "q: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"0.3*cos(0.6*t)-0.2*w1\"}\n"
        "constraints: [p]\n"
        "p: {type: variator_sim/ExpressionConstraint, order: " +
        std::to_string(order) + ", expression: \"" +
        (order == 1 ? "0.4*w1^2+w2^2-(4.5+sin(t))" : "0.8*w1*e1+2*w2*e2-cos(t)") +
        "\"}\ninitial: {velocity: [1.5, " + plainly(std::sqrt(4.5 - 0.4 * 1.5 * 1.5)) +
        "], project: true}\nprinciple: gauss\n");
    for (Principle principle : {Principle::kGauss, Principle::kGeneralizedGauss}) {
      for (const Method& method : methodsOf(scene, tolerances())) {
        Scene asked = method.scene;
        asked.principle = principle;
        const double end = sizeOf(100.0, method.tolerance == 1e-8 ? 1e5 : 1e3);
        judgeAlong(
            energy, asked, decades(end),
            "order " + std::to_string(order) + ", " + toString(principle) + ", " + method.name,
            [&](const Sample& sample, const std::string& label) {
              const double T = Circle::calcEnergy(sample);
              const double exact = 4.5 + std::sin(sample.time);
              energy.judge(std::abs(T - exact) / (4.5 * method.tolerance), label,
                           kAllowed * growth(sample.time, order == 1 ? 0 : 1));
              // what the sizes of its terms round to; |eps| may be larger than |w|
              const double size = 1.0 +
                                  std::abs(0.8 * sample.velocity[0] * sample.acceleration[0]) +
                                  std::abs(2.0 * sample.velocity[1] * sample.acceleration[1]) + T;
              residual.judge(std::abs(sample.residual[0]) / (size * kEpsilon), label, 64.0);
            });
      }
    }
  }
}

// --- a swing for ever -------------------------------------------------------------------------
TEST(Drift, OfASwingWithoutDamping) {
  Hazard motion("drift", "undamped swing, error against t", "10 .. 1e6 s");
  Hazard energy("drift", "energy of an undamped swing, error against t", "10 .. 1e6 s");
  Hazard invariant("drift", "R(t) - R(0) in range(C^T), in roundings, against t", "10 .. 1e6 s");
  for (double frequency : {1.0, 1e-3}) {
    for (int order : {0, 1, 2, 3}) {
      for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
        ElasticDrive drive;
        drive.order = order;
        drive.principle = principle;
        drive.motor = 0.0;
        drive.turning = 0.0;
        drive.stiffness = frequency * frequency * drive.reduced();
        const Scene scene = sceneFromText(drive.yaml());
        const double J[3] = {ElasticDrive::kJ1, ElasticDrive::kJ2, ElasticDrive::kJ3};
        const auto calcEnergy = [&](const Sample& s) {
          const double theta = s.angle[0] - s.angle[1];
          double sum = 0.5 * drive.stiffness * theta * theta;
          for (int i = 0; i < (order == 0 ? 2 : 3); ++i) {
            sum += 0.5 * J[i] * s.velocity[i] * s.velocity[i];
          }
          return sum;
        };
        for (const Method& method : methodsOf(scene, tolerances())) {
          Scene asked = method.scene;
          // the swing's velocity is 0.1 rad/s
          asked.solver.absolute_tolerance = 0.1 * frequency * method.tolerance;
          asked.solver.maximum_step = 1.0 / frequency;
          const bool is_slow = method.tolerance < 1e-8 && method.stepper == StepperKind::kDopri5;
          const bool is_long =
              order == 2 && method.tolerance == 1e-8 && principle == Principle::kGeneralizedGauss;
          const double longest = is_long ? 1e6 : 1e4;
          const double end = frequency < 1.0 ? 1e6 : sizeOf(is_slow ? 100.0 : 1000.0, longest);
          if (!isLongForm() && frequency < 1.0 && method.tolerance < 1e-8) continue;
          judgeAlong(
              motion, asked, decades(end),
              "order " + std::to_string(order) + ", " + toString(principle) + ", " +
                  text(frequency) + " rad/s, " + method.name,
              [&](const Sample& sample, const std::string& label) {
                const double t = sample.time;
                const double allowed = kAllowed * growth(frequency * t, 1);
                const Sample exact = drive.at(t);
                // The swing itself: what the centre does is not restored by anything, and
                // is judged by its invariant below.
                const double theta = sample.angle[0] - sample.angle[1];
                const double speed = sample.velocity[0] - sample.velocity[1];
                const double error =
                    std::max(std::abs(theta - (exact.angle[0] - exact.angle[1])) * frequency / 0.1,
                             std::abs(speed - (exact.velocity[0] - exact.velocity[1])) / 0.1);
                motion.judge(error / method.tolerance, label, allowed);
                const double start = calcEnergy(drive.at(0.0));
                energy.judge(std::abs(calcEnergy(sample) - start) / (start * method.tolerance),
                             label, allowed);
                // C = (0, -1/2, 1), and nothing constrains the first shaft. Linear in the
                // state, so that every Runge-Kutta step keeps it; a rounding per step.
                const double* R = sample.reaction_torque;
                const double size = 0.1 * frequency * 0.7;
                double broken = std::abs(R[0]);
                broken = std::max(broken, std::abs(order == 0 ? R[1] : R[1] + 0.5 * R[2]));
                const bool is_implicit = method.stepper == StepperKind::kRadau;
                // Weights of dense output are up to a thousand, so samples inside a
                // step round by as much. Newton's iteration of implicit steps leaves a
                // part of a tolerance.
                const double unit = is_implicit ? 1e-2 * method.tolerance : kEpsilon;
                invariant.judge(broken / (size * unit), label, 100.0 * allowed);
              });
        }
      }
    }
  }
}

// --- motions that are restored ----------------------------------------------------------------
TEST(Drift, OfARestoredVariator) {
  Hazard motion("drift", "restored motion of a variator, no growth (generalized_gauss: t)",
                "10 .. 1e6 s");
  Hazard residual("drift", "its residual, in 64 roundings", "10 .. 1e6 s");
  for (KnownMotion known : knownMotions({1, 2, 3}, true)) {
    const Principle principle = known.principle;
    known.restoring = 2.0;
    // Under generalized_gauss the reaction is a state, which a ratio that goes up and down
    // pumps like a swing; with a constant one its errors just add up.
    if (principle == Principle::kGeneralizedGauss) known.swing = 0.0;
    const Scene scene = known.scene();
    for (const Method& method : methodsOf(scene, tolerances())) {
      const bool is_long = known.order == 2 && !known.nonlinear &&
                           method.stepper == StepperKind::kAuto && method.tolerance == 1e-8;
      const double end = sizeOf(30.0, is_long ? 1e6 : method.tolerance < 1e-8 ? 1e3 : 1e4);
      judgeAlong(motion, method.scene, decades(end), known.label() + ", " + method.name,
                 [&](const Sample& sample, const std::string& label) {
                   test::Run run;
                   run.samples = {sample};
                   test::Run exact;
                   exact.samples = {known.at(sample.time)};
                   const double allowed =
                       kAllowed * growth(sample.time, principle == Principle::kGauss ? 0 : 1);
                   motion.judge(calcDifference(run, exact, 2, method.tolerance, method.tolerance,
                                               Columns::kAll),
                                label, allowed);
                   // psi is a difference of terms of size 5, made of time itself, whose
                   // rounding is that of t
                   residual.judge(std::abs(sample.residual[0]) / (10.0 * kEpsilon), label,
                                  64.0 * (1.0 + sample.time));
                 });
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
