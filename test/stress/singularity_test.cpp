/// Constraints whose rows C are tiny, huge, zero in one component, short of rank, or on their way
/// to one of these. The promise: the motion is right, or it stops by name.

#include "stress/methods.h"

namespace variator_sim::test {
namespace {

std::vector<double> tolerances() {
  return isLongForm() ? std::vector<double>{1e-3, 1e-5, 1e-7, 1e-9, 1e-11}
                      : std::vector<double>{1e-5, 1e-8};
}

// --- the scale of psi ----------------------------------------------------------------------------

struct Formula {
  int order;
  const char* expression;  ///< what is zero
  double w1 = 1.0;         ///< rad/s, at the start, where w2 = 0.6
};

const Formula kFormulas[] = {
    {1, "w2-(0.6+0.2*sin(0.7*t))*w1"},
    {1, "w2+0.1*sin(w2)-(0.6+0.1*cos(phi1))*w1-0.2*sin(t)", (0.6 + 0.1 * std::sin(0.6)) / 0.7},
    {2, "0.3*(e2-(0.6+0.2*sin(0.7*t))*e1)+w2-(0.6+0.2*sin(0.7*t))*w1"},
    {2, "e2+0.2*sin(e2)-0.5*e1+0.3*(w2-0.4*w1)-cos(t)"},
    {3, "j1-(0.4+0.1*w2)*j2+2*e1-e2+w1-sin(2*t)"},
};

std::string twoShafts(const std::string& principle, const Formula& formula,
                      const std::string& expression) {
  return sceneText(
      "a 1.5, b 0.8",
      {"q on a: 2*cos(1.3*t)-0.4*w1", "p on b: -0.3*w2", "k" + ofOrder(formula.order, expression)},
      "principle: " + principle + "\ninitial: {velocity: " + list({formula.w1, 0.6}) + "}");
}

/// psi, c psi and g(t, state) psi with g > 0 are the same constraint.
TEST(Singularity, ScaleOfPsi) {
  Hazard hazard("singularity", "scale of psi", "1e-12 to 1e12, factors that vary by 1e7 and 1e17");
  std::vector<std::string> factors;
  const int decades = sizeOf(12, 2);
  for (int exponent = -12; exponent <= 12; exponent += decades) {
    factors.push_back("1e" + std::to_string(exponent));
  }
  factors.emplace_back("(2+sin(3*t+w1))");
  factors.emplace_back("exp(8*sin(2*t))");
  // C that shrinks to less than 1e-10 of what it has been counts as vanished: stops.
  factors.emplace_back("exp(20*sin(2*t))");
  const std::vector<double> times = evenly(3.0, 12);
  for (const char* principle : kPrinciples) {
    for (const Formula& formula : kFormulas) {
      const test::Run reference =
          play(withSolver(sceneFromText(twoShafts(principle, formula, formula.expression)),
                          StepperKind::kFehlberg78, 1e-13),
               times);
      ASSERT_EQ(reference.samples.size(), times.size()) << reference.message;
      for (const std::string& factor : factors) {
        const std::string scaled = factor + "*(" + formula.expression + ")";
        const Scene plain = sceneFromText(twoShafts(principle, formula, scaled));
        for (const Method& method : methodsOf(plain, tolerances())) {
          const test::Run run = play(method.scene, times);
          hazard.compare(run, reference, method.scene,
                         std::string(principle) + " " + scaled + " " + method.name);
          if (factor.rfind("exp(20", 0) == 0) continue;
          EXPECT_EQ(run.reason, StopReason::kNone)
              << scaled << ", " << method.name << ": " << run.message;
        }
      }
    }
  }
}

/// w3 = 0.25 w2 + 0.2 sin t by its derivatives.
const char* const kSecondRow[] = {"w3-0.25*w2-0.2*sin(t)", "e3-0.25*e2-0.2*cos(t)",
                                  "j3-0.25*j2+0.2*sin(t)"};
const char* const kStartOfThree = "\ninitial: {velocity: [0.5, 1, 0.25], project: true}\n";

/// Two constraints whose scales lie 24 decades apart.
TEST(Singularity, ScalesOfTwoConstraints) {
  Hazard hazard("singularity", "scales of two constraints", "1e-12 and 1e12, in every order");
  const auto yaml = [](const std::string& principle, int order, const std::string& c,
                       const std::string& d) {
    // The derivatives of one motion: w1 = (0.5 + 0.1 sin t) w2, w3 = 0.25 w2 + 0.2 sin t
    std::string first = "_1-(0.5+0.1*sin(t))*_2";
    if (order == 2) first += "-0.1*cos(t)*w2";
    if (order == 3) first += "-0.2*cos(t)*e2+0.1*sin(t)*w2";
    return sceneText("a 1, b 2, c 0.5",
                     {"q on a: 3*cos(2*t)-0.2*w1", "k" + ofOrder(order, c + "*(" + first + ")"),
                      "l" + ofOrder(order, d + "*(" + kSecondRow[order - 1] + ")")},
                     "principle: " + principle + kStartOfThree);
  };
  const std::vector<double> times = evenly(3.0, 12);
  const std::vector<std::string> scales = {"1e-12", "1e-5", "1", "1e7", "1e12"};
  for (const char* principle : kPrinciples) {
    for (int order = 1; order <= 3; ++order) {
      const test::Run reference = play(withSolver(sceneFromText(yaml(principle, order, "1", "1")),
                                                  StepperKind::kFehlberg78, 1e-13),
                                       times);
      ASSERT_EQ(reference.samples.size(), times.size()) << reference.message;
      for (const std::string& c : scales) {
        for (const std::string& d : scales) {
          if (!isLongForm() && c != "1e-12" && d != "1e-12") continue;
          const Scene plain = sceneFromText(yaml(principle, order, c, d));
          compareMethods(
              hazard, plain, reference,
              std::string(principle) + " order " + std::to_string(order) + " " + c + ", " + d,
              {{1e-7}});
        }
      }
    }
  }
}

// --- one component of C is exactly zero ----------------------------------------------------------

/// psi = e_i - 2 cos 3t: the other shaft is free, c1 = 0 or c2 = 0 throughout.
TEST(Singularity, OneComponentIsZeroThroughout) {
  Hazard hazard("singularity", "c1 = 0 or c2 = 0 throughout", "orders 1 to 3");
  const std::vector<double> times = evenly(3.0, 12);
  for (const char* principle : kPrinciples) {
    for (int order = 1; order <= 3; ++order) {
      for (int imposed = 0; imposed < 2; ++imposed) {
        const int free = 1 - imposed;
        const std::string n = std::to_string(imposed + 1);
        const std::string expression = order == 1   ? "w" + n + "-sin(3*t)*2/3"
                                       : order == 2 ? "e" + n + "-2*cos(3*t)"
                                                    : "j" + n + "+6*sin(3*t)";
        const double J = free == 0 ? 1.5 : 0.8;
        // The free shaft: J e = 4 - 2 w, from rest; its reaction is 0 and stays it.
        const Scene plain = sceneFromText(
            "a 1.5, b 0.8",
            {free == 0 ? "q on a: 4-2*w1" : "q on b: 4-2*w2", "k" + ofOrder(order, expression)},
            std::string("principle: ") + principle + "\ninitial: {acceleration: " +
                list({imposed == 0 ? 2.0 : 4.0 / J, imposed == 1 ? 2.0 : 4.0 / J}) + "}");
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          sample.velocity[imposed] = std::sin(3.0 * t) * 2.0 / 3.0;
          sample.acceleration[imposed] = 2.0 * std::cos(3.0 * t);
          sample.velocity[free] = 2.0 * (1.0 - std::exp(-2.0 * t / J));
          sample.acceleration[free] = 4.0 / J * std::exp(-2.0 * t / J);
        });
        compareMethods(hazard, plain, exact, std::string(principle) + " " + expression,
                       {tolerances()});
      }
    }
  }
}

/// psi = n e + g with n = (cos nu t, sin nu t): each component of C passes through zero many times.
/// With equal inertias J and t = (-sin nu t, cos nu t) the accelerations are -g n + p t, where
///     generalized_gauss: p' = Q' t / J + g nu,   gauss: p = Q t / J.
TEST(Singularity, ComponentsPassThroughZero) {
  Hazard hazard("singularity", "components of C pass through zero", "nu = 0.1 to 100 rad/s");
  const double J = 1.2;
  const double g = 0.7;
  const double m = 3.0;
  const double end = 3.0;
  const std::vector<double> times = evenly(end, 12);
  const std::vector<double> speeds = isLongForm() ? std::vector<double>{0.1, 0.3, 1, 3, 10, 30, 100}
                                                  : std::vector<double>{0.1, 3, 40};
  for (const char* principle : kPrinciples) {
    const bool general = principle == kPrinciples[0];
    for (double nu : speeds) {
      const std::string n = exactly(nu);
      const Scene plain = sceneFromText(
          "a 1.2, b 1.2",
          {"q on a: 3*t", std::string("k: cos(") + n + "*t)*e1+sin(" + n + "*t)*e2+0.7"},
          std::string("principle: ") + principle + "\ninitial: {acceleration: [-0.7, 0]}");
      const auto acceleration = [&](double t, int i) {
        const double c = std::cos(nu * t);
        const double s = std::sin(nu * t);
        const double p = general ? m / (J * nu) * (c - 1.0) + g * nu * t : -m * t * s / J;
        return i == 0 ? -g * c - p * s : -g * s + p * c;
      };
      double velocity[2] = {};
      double reached = 0.0;
      const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
        for (int i = 0; i < 2; ++i) {
          velocity[i] += integrate([&](double x) { return acceleration(x, i); }, reached, t);
          sample.velocity[i] = velocity[i];
          sample.acceleration[i] = acceleration(t, i);
        }
        reached = t;
      });
      compareMethods(hazard, plain, exact, std::string(principle) + " nu = " + text(nu),
                     {tolerances()});
    }
  }
}

// --- C towards zero ------------------------------------------------------------------------------

/// e1^2 + e2^2 = a(t)^2 with Q = m t (cos beta, sin beta): e = a (cos theta, sin theta),
///     tan((theta - beta)/2) = tan((theta0 - beta)/2) exp(-m/J int dt/a).
/// C = 2 e is as long as 2 a.
class ChangingCircle {
 public:
  static constexpr double kJ = 1.25;
  double m = 1.25;
  double beta = 0.4;
  double theta0 = 2.0;

  Scene scene(const std::string& a, double a0) const {
    return sceneFromText("a 1.25, b 1.25",
                         {"q on a: " + exactly(m * std::cos(beta)) + "*t",
                          "p on b: " + exactly(m * std::sin(beta)) + "*t",
                          std::string("k: e1^2+e2^2-(") + a + ")^2"},
                         "initial: {acceleration: [" + plainly(a0 * std::cos(theta0)) + ", " +
                             plainly(a0 * std::sin(theta0)) + "], project: true}");
  }
  /// theta where the integral of 1/a is `sum`.
  double theta(double sum) const {
    return beta + 2.0 * std::atan(std::tan(0.5 * (theta0 - beta)) * std::exp(-m / kJ * sum));
  }
};

/// a = delta + (t - 1)^2: C shrinks to 2 delta and grows again. Only accelerations are compared
/// with the exact ones: velocities are their integral.
TEST(Singularity, ConstraintNearlyVanishes) {
  Hazard hazard("singularity", "C shrinks and grows again", "to 1 ... 1e-12 of its length");
  const ChangingCircle circle;
  const std::vector<double> times = evenly(2.0, 16);
  const int step = sizeOf(3, 1);
  for (int decade = 0; decade <= 12; decade += step) {
    const double delta = std::pow(10.0, -decade);
    const double root = std::sqrt(delta);
    const Scene plain = circle.scene(exactly(delta) + "+(t-1)^2", delta + 1.0);
    const auto theta = [&](double t) {
      return circle.theta((std::atan((t - 1.0) / root) + std::atan(1.0 / root)) / root);
    };
    for (const Method& method : methodsOf(plain, tolerances())) {
      const test::Run run = play(method.scene, times);
      const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
        const double a = delta + (t - 1.0) * (t - 1.0);
        sample.acceleration[0] = a * std::cos(theta(t));
        sample.acceleration[1] = a * std::sin(theta(t));
      });
      test::Run bare = run;
      for (Sample& sample : bare.samples) std::fill(sample.velocity, sample.velocity + 2, 0.0);
      hazard.compare(bare, exact, method.scene, "to " + text(delta) + " " + method.name);
    }
  }
}

/// a = 1 - t/T goes through zero at T, where C = 0 and the motion is not determined any more: the
/// accelerations behind it are (1 - t/T)(cos theta, sin theta) with
///     tan((theta - beta)/2) = c |1 - t/T|^p,   p = m T / J,
/// for any c. It has to stop there (or, under a stepper that steps across, c is undefined).
TEST(Singularity, ConstraintVanishes) {
  Hazard hazard("singularity", "C goes through zero", "exponents 0.3 to 3 of the approach");
  const std::vector<double> instants =
      isLongForm() ? std::vector<double>{0.1, 0.3, 0.5, 0.731, 1.0, 1.234567, 2.0}
                   : std::vector<double>{0.731, 1.0};
  const std::vector<double> exponents = isLongForm()
                                            ? std::vector<double>{0.3, 0.7, 1.0, 1.5, 2.0, 3.0}
                                            : std::vector<double>{0.7, 1.0, 2.0};
  for (double T : instants) {
    for (double p : exponents) {
      ChangingCircle circle;
      circle.m = p * ChangingCircle::kJ / T;
      const Scene plain = circle.scene("1-t/" + exactly(T), 1.0);
      std::vector<double> times = evenly(0.99 * T, 8);
      const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
        const double a = 1.0 - t / T;
        const double theta = circle.theta(-T * std::log(a));
        sample.acceleration[0] = a * std::cos(theta);
        sample.acceleration[1] = a * std::sin(theta);
      });
      times.push_back(1.5 * T);
      for (const Method& method : methodsOf(plain, tolerances())) {
        test::Run run = play(method.scene, times);
        const std::string label = "T = " + text(T) + ", exponent " + text(p) + " " + method.name;
        for (Sample& sample : run.samples) std::fill(sample.velocity, sample.velocity + 2, 0.0);
        // Up to the stop it is right ...
        const double error = calcDifference(run, exact, 2, method.tolerance, method.tolerance);
        hazard.judge(error, label);
        // ... and the stop comes there. Only a step that leaves C as it was (its zero lies
        // inside, and beyond it C grows again in the same direction) may pass: where the motion
        // is not determined, no error tells of that (doc/evidence.md).
        if (run.reason == StopReason::kNone) continue;
        hazard.stopped(run.reason, label);
        EXPECT_LE(run.end, T * (1.0 + 1e-9)) << label;
        EXPECT_GE(run.end, 0.99 * T) << label << ": " << run.message;
      }
    }
  }
}

/// Slip s = w2 - u w1 with tau s' + s = 0 and tau = (T - t)/q: s = s0 (1 - t/T)^q, and C = tau (-u,
/// 1) passes through zero at T.
struct VanishingSlip {
  static constexpr double T = 0.737;
  int q;

  static constexpr double u = 0.5;
  Scene scene(const std::string& principle) const {
    return sceneFromText("a 1.5, b 0.8",
                         {"k: (0.737-t)/" + std::to_string(q) + "*(e2-0.5*e1)+w2-0.5*w1"},
                         "principle: " + principle + "\ninitial: {velocity: [0, 1]}");
  }
  void operator()(double t, Sample& sample) const {
    // w = w(0) + J^-1 (-u, 1) lambda, s = 1 + A lambda, since nothing but the reactions acts
    const double A = u * u / 1.5 + 1.0 / 0.8;
    const double lambda = (std::pow(1.0 - t / T, q) - 1.0) / A;
    const double rate = -q / T * std::pow(1.0 - t / T, q - 1) / A;
    sample.velocity[0] = -u / 1.5 * lambda;
    sample.velocity[1] = 1.0 + lambda / 0.8;
    sample.acceleration[0] = -u / 1.5 * rate;
    sample.acceleration[1] = rate / 0.8;
  }
};

/// The motion beyond is not determined; it stops, or goes on smoothly.
TEST(Singularity, TimeConstantGoesThroughZero) {
  Hazard hazard("singularity", "tau of a slip goes through zero", "q = 1, 2, 3");
  // None at T itself: that is a test of its own.
  const std::vector<double> times = evenly(1.5 * VanishingSlip::T, 13);
  for (const char* principle : kPrinciples) {
    for (int q = 1; q <= 3; ++q) {
      const Scene plain = VanishingSlip{q}.scene(principle);
      const test::Run exact = tabulate(times, VanishingSlip{q});
      for (const Method& method : methodsOf(plain, tolerances())) {
        const test::Run run = play(method.scene, times);
        hazard.compare(run, exact, method.scene,
                       std::string(principle) + " q = " + std::to_string(q) + " " + method.name);
        EXPECT_TRUE(run.reason == StopReason::kNone || run.end > 0.9 * VanishingSlip::T)
            << run.message;
      }
    }
  }
}

/// The same, sampled exactly at T among others: samples may not change the motion, nor may it hang.
TEST(Singularity, SampledExactlyAtTheSingularInstant) {
  Hazard hazard("singularity", "sampled exactly at a singular instant", "q = 1 to 3");
  const std::vector<double> times = {0.2, 0.5, 0.7, VanishingSlip::T, 0.8, 1.1};
  for (const char* principle : kPrinciples) {
    for (int q = 1; q <= 3; ++q) {
      const Scene plain = VanishingSlip{q}.scene(principle);
      const test::Run exact = tabulate(times, VanishingSlip{q});
      for (const Method& method : methodsOf(plain, tolerances())) {
        const std::string label =
            std::string(principle) + " q = " + std::to_string(q) + " " + method.name;
        const test::Run run = play(method.scene, times);
        hazard.compare(run, exact, method.scene, label);
        // The time never goes back behind a sample that has been given.
        if (!run.samples.empty()) {
          EXPECT_GE(run.end, run.samples.back().time) << label << ": " << run.message;
        }
        // The motion without that sample ends in the same way.
        std::vector<double> others = times;
        others.erase(others.begin() + 3);
        EXPECT_EQ(play(method.scene, others).reason, run.reason) << label << ": " << run.message;
      }
    }
  }
}

/// J1 w1 e1 + J2 w2 e2 = -P: the energy ends at t = E/P, where both velocities and so C are zero.
TEST(Singularity, EnergyRunsOut) {
  Hazard hazard("singularity", "C goes to zero like a root", "power 1e-3 to 1e3 W");
  const std::vector<double> powers = isLongForm()
                                         ? std::vector<double>{1e-3, 1e-2, 0.1, 1, 10, 100, 1e3}
                                         : std::vector<double>{1e-3, 1, 1e3};
  for (const char* principle : kPrinciples) {
    for (double power : powers) {
      const double E = 0.5 * (1.5 * 4.0 + 0.8 * 1.0);
      const double end = E / power;
      const Scene plain =
          sceneFromText("a 1.5, b 0.8", {"k: 1.5*w1*e1+0.8*w2*e2+" + exactly(power)},
                        std::string("principle: ") + principle + "\ninitial: {velocity: [2, -1]}");
      std::vector<double> times = evenly(0.999 * end, 10);
      times.push_back(1.1 * end);
      for (const Method& method : methodsOf(plain, tolerances())) {
        const test::Run run = play(method.scene, times);
        const std::string label =
            std::string(principle) + " P = " + text(power) + " " + method.name;
        double worst = 0.0;
        for (const Sample& sample : run.samples) {
          const double* w = sample.velocity;
          const double energy = 0.5 * (1.5 * w[0] * w[0] + 0.8 * w[1] * w[1]);
          const double error = std::abs(energy - (E - power * sample.time));
          // dE = J w dw, each w within a tolerance of itself
          const double unit =
              method.tolerance * (1.5 * std::abs(w[0]) * (1.0 + 2.0) + 0.8 * std::abs(w[1]) * 2.0) +
              1e-300;
          worst = std::max(worst, error / unit);
        }
        hazard.judge(worst, label);
        hazard.stopped(run.reason, label);
        // The energy is known to a tolerance of its scale, and so is its end.
        EXPECT_LE(run.end, end * (1.0 + 1e-6) + kAllowed * method.tolerance * 3.0 * E / power)
            << label;
        EXPECT_GE(run.end, 0.99 * end) << label << ": " << run.message;
      }
    }
  }
}

// --- rank below k --------------------------------------------------------------------------------

std::string threeShafts(const std::string& principle, int order, const std::string& k,
                        const std::string& l) {
  return sceneText("a 1, b 2, c 0.5",
                   {"q on a: 3*cos(2*t)", "k" + ofOrder(order, k), "l" + ofOrder(order, l)},
                   "principle: " + principle);
}

/// Dependent from the start, whether they contradict each other or not.
TEST(Singularity, RankIsBelowTheNumberOfConstraints) {
  Hazard hazard("singularity", "rank below k from the start", "orders 1 to 3, factors 1e-9 to 1e9");
  for (const char* principle : kPrinciples) {
    for (int order = 1; order <= 3; ++order) {
      for (int exponent = -9; exponent <= 9; exponent += sizeOf(3, 1)) {
        for (const char* more : {"", "-0.3", "-sin(t)"}) {
          const std::string row = "_1-0.3*_2+0.7*_3";
          const std::string second = "1e" + std::to_string(exponent) + "*(" + row + more + ")";
          test::Run run;
          const std::string label =
              std::string(principle) + " order " + std::to_string(order) + " and " + second;
          try {
            run = play(sceneFromText(threeShafts(principle, order, row, second)), evenly(1.0, 4));
          } catch (const SceneError& error) {
            hazard.named("SceneError", label);
            continue;
          }
          EXPECT_TRUE(run.samples.empty()) << label;
          hazard.stopped(run.reason, label);
        }
      }
    }
  }
}

/// Two rows, of which the second one is the first plus q(t) times another: as long as q is not zero
/// the motion is that of q = 1. At q = 0 it stops, or goes on unchanged (both sides have the same
/// motion).
TEST(Singularity, RowsBecomeDependent) {
  Hazard hazard("singularity", "rows become dependent along the way",
                "q of degree 1 to 3, orders 1 to 3");
  const std::vector<double> times = evenly(2.0, 16);
  // None of them is an instant of a sample: SampledExactlyAtTheSingularInstant has that.
  const std::vector<double> instants = isLongForm()
                                           ? std::vector<double>{0.11, 0.36, 0.71, 1.01, 1.26, 1.61}
                                           : std::vector<double>{0.71, 1.26};
  for (const char* principle : kPrinciples) {
    for (int order = 1; order <= 3; ++order) {
      const std::string k = "_1-0.5*_2";
      const std::string other = kSecondRow[order - 1];
      const test::Run reference =
          play(withSolver(sceneFromText(threeShafts(principle, order, k, other) + kStartOfThree),
                          StepperKind::kFehlberg78, 1e-13),
               times);
      ASSERT_EQ(reference.samples.size(), times.size()) << reference.message;
      for (double T : instants) {
        for (int degree = 1; degree <= 3; ++degree) {
          const std::string q = "(t-" + exactly(T) + ")^" + std::to_string(degree);
          const Scene plain = sceneFromText(
              threeShafts(principle, order, k, k + "+" + q + "*(" + other + ")") + kStartOfThree);
          for (const Method& method : methodsOf(plain, tolerances())) {
            const test::Run run = play(method.scene, times);
            const std::string label = std::string(principle) + " order " + std::to_string(order) +
                                      " T = " + text(T) + " degree " + std::to_string(degree) +
                                      " " + method.name;
            hazard.compare(run, reference, method.scene, label);
            EXPECT_TRUE(run.reason == StopReason::kNone || run.end > 0.5 * T)
                << label << ": " << run.message;
          }
        }
      }
    }
  }
}

/// The second row turns into the first one by the motion itself, and behind that the two are
/// independent again: w1 e1 + w2 e2 and e1 + e2 in a scene where w1 = w2 comes.
TEST(Singularity, StateMakesRowsDependent) {
  Hazard hazard("singularity", "the state makes rows dependent", "speed differences 0.1 to 10");
  // e1 + e2 + e3 = 0 and w1 e1 + w2 e2 + w3 e3 = P: dependent where w1 = w2 = w3, that is where the
  // energy has fallen to that of the common speed.
  const std::vector<double> differences =
      isLongForm() ? std::vector<double>{0.1, 0.3, 1, 3, 10} : std::vector<double>{0.1, 1, 10};
  for (const char* principle : kPrinciples) {
    for (double d : differences) {
      const double power = 1.0;
      const double end = d * d;  // 1/2 sum (w - mean)^2 = d^2 with w = mean + (d, -d, 0)
      std::vector<double> times = evenly(0.99 * end, 8);
      times.push_back(1.2 * end);
      const Scene plain =
          sceneFromText("a 1, b 1, c 1", {"k: e1+e2+e3", "l: w1*e1+w2*e2+w3*e3+1"},
                        "principle: " + std::string(principle) + "\ninitial: {velocity: [" +
                            plainly(2.0 + d) + ", " + plainly(2.0 - d) + ", 2]}");
      for (const Method& method : methodsOf(plain, tolerances())) {
        const test::Run run = play(method.scene, times);
        const std::string label = std::string(principle) + " d = " + text(d) + " " + method.name;
        double worst = 0.0;
        for (const Sample& sample : run.samples) {
          const double* w = sample.velocity;
          const double energy = 0.5 * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
          const double exact = 6.0 + d * d - power * sample.time;
          worst =
              std::max(worst, std::abs(energy - exact) / (method.tolerance * (1.0 + 2.0 * exact)));
        }
        hazard.judge(worst, label);
        hazard.stopped(run.reason, label);
        // The energy is known to a tolerance of its scale, and so is the end of what can go.
        const double scale = 1.0 + 2.0 * (6.0 + d * d);
        EXPECT_LE(run.end, end * (1.0 + 1e-6) + kAllowed * method.tolerance * scale / power)
            << label;
        EXPECT_GE(run.end, 0.9 * end) << label << ": " << run.message;
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
