/// Laws with kinks: abs, min, max, tables, friction through zero speed, rate limits and clamped
/// commands, against exact solutions, or against the same motion put together from smooth pieces.
#include "stress/methods.h"

namespace variator_sim::test {
namespace {

/// From weak kinks that no error estimate sees to strong ones.
std::vector<double> strengths() {
  return isLongForm()
             ? std::vector<double>{1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10}
             : std::vector<double>{1e-9, 1e-6, 1e-3, 0.1, 10};
}

// --- kinks at known times ------------------------------------------------------------------------

struct TimeFormula {
  const char* name;
  const char* formula;           ///< f(t) with "K" for the strength
  double (*integral)(double t);  ///< int f / K
  double (*value)(double t);     ///< f / K
};

constexpr double kP = 0.637;  // the kinks' place, s

const TimeFormula kTimeFormulas[] = {
    {"abs", "K*abs(t-0.637)",
     [](double t) {
       const double x = t - kP;
       return 0.5 * (kP * kP + x * std::abs(x));
     },
     [](double t) { return std::abs(t - kP); }},
    {"max", "K*max(0,t-0.637)", [](double t) { return 0.5 * std::pow(std::max(0.0, t - kP), 2); },
     [](double t) { return std::max(0.0, t - kP); }},
    {"min, nested in a square root's place", "K*min(t,0.637)",
     [](double t) { return t < kP ? 0.5 * t * t : 0.5 * kP * kP + kP * (t - kP); },
     [](double t) { return std::min(t, kP); }},
    {"two kinks side by side", "K*(max(0,t-0.637)-max(0,t-0.6370001))",
     [](double t) {
       return 0.5 *
              (std::pow(std::max(0.0, t - kP), 2) - std::pow(std::max(0.0, t - 0.6370001), 2));
     },
     [](double t) { return std::max(0.0, t - kP) - std::max(0.0, t - 0.6370001); }},
    {"touched and not crossed", "K*abs((t-0.637)^2)",
     [](double t) { return (std::pow(t - kP, 3) + std::pow(kP, 3)) / 3.0; },
     [](double t) { return (t - kP) * (t - kP); }},
    {"a dead zone", "K*(max(0,t-0.8)+min(0,t-0.637))",
     [](double t) {
       const double low = t < kP ? 0.5 * (t - kP) * (t - kP) : 0.0;
       return 0.5 * std::pow(std::max(0.0, t - 0.8), 2) + low - 0.5 * kP * kP;
     },
     [](double t) { return std::max(0.0, t - 0.8) + std::min(0.0, t - kP); }},
};

std::string withStrength(const std::string& formula, double strength) {
  std::string result = formula;
  for (std::size_t at = result.find('K'); at != std::string::npos; at = result.find('K', at)) {
    result.replace(at, 1, exactly(strength));
  }
  return result;
}

/// As a torque (a), and as psi of a driven shaft (order 2), with a cosine beside them.
TEST(Kinks, AtTimes) {
  Hazard hazard("kinks", "abs, min and max of t in torques and psi", "factors 1e-9 to 10");
  const std::vector<double> times = evenly(1.5, 11);
  for (const char* principle : kPrinciples) {
    for (const TimeFormula& f : kTimeFormulas) {
      for (double strength : strengths()) {
        const std::string formula = withStrength(f.formula, strength);
        for (int place = 0; place < 2; ++place) {
          const Scene plain =
              sceneFromText("a 1.5, b 0.8",
                            {place == 0 ? "q on a: 1.5*(cos(t)+" + formula + ")" : "q on a: 0",
                             place == 0 ? "k: e2-1" : "k: e1-cos(t)-" + formula},
                            std::string("principle: ") + principle);
          const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
            sample.velocity[0] = std::sin(t) + strength * f.integral(t);
            sample.acceleration[0] = std::cos(t) + strength * f.value(t);
            if (place == 0) {
              sample.velocity[1] = t;
              sample.acceleration[1] = 1.0;
            }
          });
          compareMethods(hazard, plain, exact,
                         std::string(principle) + (place == 0 ? " torque " : " psi ") + formula);
        }
      }
    }
  }
}

// --- kinks at places of the motion ---------------------------------------------------------------

/// One shaft, J w' = T0 - c1 w - K min(0, w) and the like: exponentials on both sides of w = 0,
/// whose crossing is known.
struct Side {
  double drive;  ///< e = drive - damping w
  double damping;
  double velocity(double w0, double t) const {
    if (damping == 0.0) return w0 + drive * t;
    return drive / damping + (w0 - drive / damping) * std::exp(-damping * t);
  }
  /// When w becomes `w`; infinity when never.
  double reaches(double w0, double w) const {
    if (damping == 0.0) return (w - w0) / drive > 0.0 ? (w - w0) / drive : HUGE_VAL;
    const double ratio = (w - drive / damping) / (w0 - drive / damping);
    const double t = ratio > 0.0 ? -std::log(ratio) / damping : -1.0;
    return t > 0.0 ? t : HUGE_VAL;
  }
};

TEST(Kinks, AtZeroSpeed) {
  Hazard hazard("kinks", "abs, min and max of a speed that changes its sign",
                "factors 1e-9 to 10, orders 0 to 3 of a gear");
  const std::vector<double> times = evenly(3.0, 13);
  struct Law {
    const char* formula;
    double below;  ///< dQ/dw / -K where w < 0
    double above;
  };
  const Law laws[] = {
      {"-K*min(0,w1)", 1.0, 0.0}, {"-K*max(0,w1)", 0.0, 1.0}, {"-K*abs(w1)", -1.0, 1.0}};
  for (const char* principle : kPrinciples) {
    for (const Law& law : laws) {
      for (double strength : strengths()) {
        for (int order = 0; order <= 3; ++order) {
          // A gear of ratio 0.5 adds its inertia and changes nothing else.
          const double inertia = gearInertia(order);
          const Side below = {1.0 / inertia, (0.2 + strength * law.below) / inertia};
          const Side above = {1.0 / inertia, (0.2 + strength * law.above) / inertia};
          const double w0 = -0.9;
          if (below.damping > 0.0 && below.drive / below.damping < 0.0) continue;
          const double crossing = below.reaches(w0, 0.0);
          const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
            const double w =
                t < crossing ? below.velocity(w0, t) : above.velocity(0.0, t - crossing);
            const Side& side = t < crossing ? below : above;
            sample.velocity[0] = w;
            sample.acceleration[0] = side.drive - side.damping * w;
            writeGear(order, sample);
          });
          const std::string torque = "q on a: 1-0.2*w1" + withStrength(law.formula, strength);
          const Scene plain =
              sceneFromText(gearText(order, {torque}, w0, below.drive - below.damping * w0) +
                            "principle: " + principle);
          // w = drive/damping where the damping is negative grows like exp(-damping t).
          const double growth = std::exp(std::max({0.0, -below.damping, -above.damping}) * 3.0);
          compareMethods(hazard, plain, exact,
                         std::string(principle) + " " + torque + " order " + std::to_string(order),
                         {}, kAllowed * growth);
        }
      }
    }
  }
}

/// psi with a kink at a speed: tau e1 + w1 - 1 + K min(0, w1): C is smooth, c0 jumps.
TEST(Kinks, OfConstraintsAtZeroSpeed) {
  Hazard hazard("kinks", "abs, min and max of a speed in psi", "factors 1e-9 to 10");
  const std::vector<double> times = evenly(3.0, 13);
  for (const char* principle : kPrinciples) {
    for (double strength : strengths()) {
      const Side below = {1.0, 1.0 + strength};  // e1 = 1 - w1 - K min(0, w1)
      const Side above = {1.0, 1.0};
      const double w0 = -0.9;
      const double crossing = below.reaches(w0, 0.0);
      const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
        const Side& side = t < crossing ? below : above;
        sample.velocity[0] =
            t < crossing ? below.velocity(w0, t) : above.velocity(0.0, t - crossing);
        sample.acceleration[0] = side.drive - side.damping * sample.velocity[0];
      });
      const Scene plain = sceneFromText(
          "a 1.5, b 0.8", {"k: e1+w1-1+" + exactly(strength) + "*min(0,w1)"},
          std::string("principle: ") + principle + "\ninitial: {velocity: [-0.9, 0]}");
      compareMethods(hazard, plain, exact, std::string(principle) + " K = " + text(strength));
    }
  }
}

/// A kink at an angle: J e = -k max(0, phi) (a stop with a spring): a shaft flies at constant
/// speed, swings half a period in the stop and comes back.
TEST(Kinks, AtAnAngle) {
  Hazard hazard("kinks", "a spring with play", "stiffness 1e-9 to 1e5 N m/rad");
  const double J = 1.5;
  const double w0 = 2.0;
  const double before = 0.35;  // s to the stop
  const std::vector<double> times = evenly(1.5, 13);
  const std::vector<double> stiffness =
      isLongForm() ? std::vector<double>{1e-9, 1e-7, 1e-5, 1e-3, 0.1, 1, 10, 100, 1e3, 1e4, 1e5}
                   : std::vector<double>{1e-6, 1e-3, 1, 100, 1e5};
  for (const char* principle : kPrinciples) {
    for (double k : stiffness) {
      const double frequency = std::sqrt(k / J);
      const double half = std::acos(-1.0) / frequency;
      const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
        const double x = t - before;
        sample.velocity[0] = x < 0.0 ? w0 : x < half ? w0 * std::cos(frequency * x) : -w0;
        sample.acceleration[0] =
            x < 0.0 || x > half ? 0.0 : -w0 * frequency * std::sin(frequency * x);
      });
      const Scene plain = sceneFromText(
          gearText(0, {"q on a: -" + exactly(k) + "*max(0,phi1)"}, w0, 0.0, -before * w0) +
          "principle: " + principle);
      for (const Method& method : methodsOf(plain, sweptTolerances())) {
        const test::Run run = play(method.scene, times);
        const std::string label = std::string(principle) + " k = " + text(k) + " " + method.name;
        // In the stop an error of the velocity of d is one of the acceleration of frequency d,
        // and one of the acceleration (whose size is w0 frequency) comes back as velocity.
        const double allowed = kAllowed * std::max(1.0, frequency);
        hazard.compare(run, exact, method.scene, label, allowed);
        // An implicit step whose matrix is from before the stop knows nothing of it, and Newton's
        // iteration may fail at every length: a stop by name (weakness: it need not be).
        if (method.stepper == StepperKind::kRadau) continue;
        EXPECT_EQ(run.reason, StopReason::kNone) << label << ": " << run.message;
      }
    }
  }
}

// --- built-in laws -------------------------------------------------------------------------------

/// A scene with one of the built-in laws against a reference by fehlberg78 at a far tighter
/// tolerance with short steps, so that nothing is stepped over. Under `gauss` the accelerations are
/// no part of the state but a function of it, as steep as the law is: they have a line of their
/// own.
void compareWithShortSteps(Hazard& hazard, Hazard& accelerations, const std::string& label,
                           const std::string& yaml, const std::vector<double>& times,
                           const std::vector<TimedCommand>& commands = {}, double growth = 1.0,
                           double longest = 1e-3, double reference_tolerance = 1e-13) {
  for (const char* principle : kPrinciples) {
    const Scene plain = sceneFromText(yaml + "principle: " + principle + "\n");
    Scene tight = withSolver(plain, StepperKind::kFehlberg78, reference_tolerance);
    tight.solver.maximum_step = longest;
    const test::Run reference = play(tight, times, commands);
    ASSERT_EQ(reference.samples.size(), times.size()) << label << ": " << reference.message;
    for (const Method& method : methodsOf(plain, sweptTolerances())) {
      const test::Run run = play(method.scene, times, commands);
      const std::string full = label + " " + principle + " " + method.name;
      if (method.scene.principle == Principle::kGauss) {
        hazard.compare(run, reference, method.scene, full, kAllowed * growth, Columns::kVelocity);
        accelerations.compare(run, reference, method.scene, full, kAllowed * growth);
      } else {
        hazard.compare(run, reference, method.scene, full, kAllowed * growth);
      }
      EXPECT_EQ(run.reason, StopReason::kNone) << full << ": " << run.message;
    }
  }
}

std::string gear(std::vector<std::string> torques, double w) {
  torques.emplace_back("k: e2-0.5*e1");
  return sceneText("a 1.5, b 0.8", torques, "initial: {velocity: " + list({w, 0.5 * w}) + "}");
}

/// Friction through zero speed: a torque that swings, friction weaker and stronger than it.
TEST(Kinks, FrictionThroughZeroSpeed) {
  Hazard hazard("kinks", "friction through zero speed",
                "regularization 1 to 1e-4 rad/s, coulomb 0.1 to 10 N m against 2 N m");
  Hazard accelerations("kinks", "friction through zero speed, accelerations under gauss",
                       "the same");
  const std::vector<double> times = evenly(4.0, 9);
  const std::vector<double> widths =
      isLongForm() ? std::vector<double>{1, 0.1, 1e-2, 1e-3, 1e-4} : std::vector<double>{0.1, 1e-3};
  for (double width : widths) {
    for (double coulomb : {0.1, 1.0, 10.0}) {
      const std::vector<std::string> laws = {
          "m on a: 2*cos(3*t)", "f = Friction, shaft: a, coulomb: " + plainly(coulomb) +
                                    ", regularization_speed: " + plainly(width)};
      // A shaft that is caught in the layer follows Q - T tanh(w/width) = 0 at once: an error of w
      // within the layer is coulomb/width/J times as large in the acceleration.
      compareWithShortSteps(hazard, accelerations,
                            "width " + text(width) + ", coulomb " + text(coulomb), gear(laws, 1.0),
                            times, {}, 1.0, std::min(1e-2, 0.1 * width),
                            // rounding of w is coulomb/width/J of it in the acceleration
                            width < 1e-3 ? 1e-12 : 1e-13);
    }
  }
}

/// Tables: through their points and beyond their ends.
TEST(Kinks, Tables) {
  Hazard hazard("kinks", "tables' points and ends",
                "motor, grade, ratio, full load; 1 to 1000 of speed");
  Hazard accelerations("kinks", "tables' points and ends, accelerations under gauss", "the same");
  const std::vector<double> times = evenly(3.0, 9);
  for (double scale : {1.0, 10.0, 1000.0}) {
    const std::string s = plainly(scale);
    const auto scaled = [&](std::vector<double> values) {
      for (double& value : values) value *= scale;
      return list(values);
    };
    for (const char* beyond : {"constant", "linear"}) {
      compareWithShortSteps(
          hazard, accelerations, std::string("motor table, beyond ") + beyond + ", scale " + s,
          gear({"m = MotorCurve, shaft: a, characteristic: table, table: {speed: " +
                    scaled({0.0, 0.5, 1.1, 1.2, 1.9}) +
                    ", torque: " + scaled({3.0, 3.2, 2.0, 4.0, 1.0}) + ", beyond: " + beyond + "}",
                "l on b: " + s + "*1.5*cos(2.5*t)"},
               -0.3 * scale),
          // The torque rises with the speed between 1.1 and 1.2: errors grow as the acceleration
          // does there, from about (2 - 1.5)/1.7 to (4 + 1.5)/1.7 at the most.
          times, {}, 11.0, 1e-2);
    }
  }
  compareWithShortSteps(
      hazard, accelerations, "grade by time",
      gear({"v = VehicleResistance, shaft: a, law: davis, wheel_radius: 0.5, constant: 1, linear: "
            "0.2, quadratic: 0.1, mass: 3, grade: {time: [0.2, 0.7, 0.75, 1.9], grade: [0, 0.3, "
            "-0.3, 0.1]}"},
           6.0),
      times, {}, 1.0, 2e-3);
  compareWithShortSteps(
      hazard, accelerations, "diesel",
      gear({"d = DieselEngine, shaft: a, full_load: {speed: [0, 1, 2, 2.2, 4], torque: [0, 4, 5, "
            "2, 0]}, rack: 0.5, friction: {constant: 0.3, linear: 0.1}, idle_governor: {speed: "
            "0.8, band: 0.1}",
            "l on b: -2*cos(2*t)"},
           1.5),
      times, {}, 3.0, 2e-3);
  compareWithShortSteps(
      hazard, accelerations, "a propeller that turns round",
      gear({"p = Propeller, shaft: b, coefficient: 2", "m on a: 3*cos(2*t)"}, -1.0), times, {}, 1.0,
      2e-3);
  compareWithShortSteps(
      hazard, accelerations, "a cut",
      gear({"c = CuttingTorque, shaft: a, torque: 3, begin: 0.31, ramp: 0.05, end: 1.7",
            "m on a: 4-w1"},
           2.0),
      times, {}, 1.0, 1e-3);
  // A ratio by a table (order 1)
  compareWithShortSteps(
      hazard, accelerations, "a ratio's table",
      sceneText("a 1.5, b 0.8",
                {"m on a: 3*cos(2*t)",
                 "k = KinematicRatio, shafts: [a, b], ratio: {times: [0.2, 0.9, 1.1, 2], values: "
                 "[0.5, 0.8, 0.6, 1]}"},
                "initial: {velocity: [1, 0.5]}"),
      times, {}, 1.0, 1e-3);
}

/// Rate limits that begin, turn and arrive; commands beyond their limits; timeouts.
TEST(Kinks, RateLimitsAndClamps) {
  Hazard hazard("kinks", "rate limits, clamped commands and timeouts", "rates 1e-2 to 1e7 N m/s");
  const double J = 1.5;
  const std::vector<double> times = evenly(2.0, 13);
  std::vector<double> rates;
  for (int decade = -2; decade <= 7; decade += sizeOf(3, 1))
    rates.push_back(std::pow(10.0, decade));
  for (const char* principle : kPrinciples) {
    for (double rate : rates) {
      // Up to 3 (a command of 5, clamped), before it is there perhaps down to -1; at 1.4 s zero by
      // the timeout of 0.6 s after the last command.
      const Scene plain = sceneFromText("a 1.5",
                                        {"m on a from m, hold: rate_limit, rate: " + plainly(rate) +
                                             ", min: -2, max: 3, timeout: 0.6, on_timeout: zero",
                                         "q on a: -0.6*w1"},
                                        std::string("principle: ") + principle);
      const std::vector<TimedCommand> commands = {{0.3, 0, 5.0}, {0.8, 0, -1.0}};
      // u is piecewise linear: (from, value, slope)
      struct Piece {
        double from, u, slope;
      };
      std::vector<Piece> pieces = {{0.0, 0.0, 0.0}};
      const auto target = [&](double t, double goal) {
        while (pieces.back().from > t) pieces.pop_back();
        const Piece last = pieces.back();
        const double u = last.u + last.slope * (t - last.from);
        const double slope = goal > u ? rate : -rate;
        pieces.push_back({t, u, slope});
        pieces.push_back({t + (goal - u) / slope, goal, 0.0});
      };
      target(0.3, 3.0);
      target(0.8, -1.0);
      target(1.4, 0.0);
      const double c = 0.6 / J;
      const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
        double w = 0.0;
        double u_end = 0.0;
        for (std::size_t i = 0; i < pieces.size() && pieces[i].from <= t; ++i) {
          const double h =
              (i + 1 < pieces.size() ? std::min(t, pieces[i + 1].from) : t) - pieces[i].from;
          const double u = pieces[i].u / J;
          const double s = pieces[i].slope / J;
          // w' = u + s x - c w
          const double E = -std::expm1(-c * h);  // 1 - exp(-c h)
          // (h - E/c)/c by its series where it cancels
          const double x = c * h;
          const double ramp = x < 1e-3 ? h * h * (0.5 - x / 6.0 + x * x / 24.0) : (h - E / c) / c;
          w = w * std::exp(-c * h) + u * E / c + s * ramp;
          u_end = u + s * h;
        }
        sample.velocity[0] = w;
        sample.acceleration[0] = u_end - c * w;
      });
      for (const Method& method : methodsOf(plain, sweptTolerances())) {
        const test::Run run = play(method.scene, times, commands);
        const std::string label =
            std::string(principle) + " rate " + text(rate) + " " + method.name;
        // The ends of a ramp are known to 2e-16 s, its torque to that times the rate.
        const double rounding = 2.3e-16 * rate / J / method.tolerance;
        hazard.compare(run, exact, method.scene, label, kAllowed + rounding);
        if (rounding < 0.1) {
          EXPECT_EQ(run.reason, StopReason::kNone) << label << ": " << run.message;
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
