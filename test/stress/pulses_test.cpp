/// Features narrower than a step: pulses of time, angle and velocity, pairs of crossings that
/// barely are, many crossings within a step, tables whose points lie closer together than steps,
/// and motions that set in from rest. All against closed forms; nothing but a look inside of the
/// steps can see most of them.

#include <random>

#include "stress/methods.h"

namespace variator_sim::test {
namespace {

/// Widths of pulses with a period of 1.
std::vector<double> widths() {
  return isLongForm() ? std::vector<double>{1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7}
                      : std::vector<double>{1e-1, 1e-3, 1e-5, 1e-7};
}

/// A pulse of height 1 between x = -1 and 1.
struct Shape {
  const char* name;
  const char* formula;           ///< of X = x
  double area;                   ///< its integral from -1 to 1
  double (*integral)(double x);  ///< the same from -1 to x
};

const Shape kShapes[] = {
    {"triangle", "max(0,1-abs(X))", 1.0,
     [](double x) {
       return x < 0.0 ? 0.5 * (1.0 + x) * (1.0 + x) : 1.0 - 0.5 * (1.0 - x) * (1.0 - x);
     }},
    {"parabola", "max(0,1-X^2)", 4.0 / 3.0,
     [](double x) { return x - x * x * x / 3.0 + 2.0 / 3.0; }},
    {"flat top", "min(1,max(0,4-4*abs(X)))", 1.75,
     [](double x) {
       const double y = std::abs(x);  // from the middle to y
       const double half = y < 0.75 ? y : 0.875 - 2.0 * (1.0 - y) * (1.0 - y);
       return 0.875 + std::copysign(half, x);
     }},
};

std::string replaced(std::string formula, char letter, const std::string& by) {
  for (std::size_t at = formula.find(letter); at != std::string::npos;
       at = formula.find(letter, at + by.size())) {
    formula.replace(at, 1, by);
  }
  return formula;
}

/// `n` pulses of half width `width` at offset + 0, 1, 2, ... of `variable`.
std::string pulses(const Shape& shape, const std::string& variable, double offset, double width,
                   int n) {
  std::string sum;
  for (int i = 0; i < n; ++i) {
    const std::string x = "((" + variable + "-" + exactly(offset + i) + ")/" + exactly(width) + ")";
    sum += (i == 0 ? "" : "+") + replaced(shape.formula, 'X', x);
  }
  return "(" + sum + ")";
}

std::string withPrinciple(const std::string& yaml, const std::string& principle) {
  return yaml + "principle: " + principle + "\n";
}

/// Every stepper and tolerance against `exact`; nothing has a reason to stop. `allowed` of the
/// tolerance; unless it is finite the closed form says nothing at that tolerance.
template <class Allowed>
void compareAll(Hazard& hazard, const std::string& yaml, const Run& exact,
                const std::vector<double>& times, const std::string& label, Allowed allowed,
                Columns columns = Columns::kVelocityAndAcceleration, bool explicit_only = false) {
  const Scene plain = sceneFromText(yaml);
  for (const Method& method : methodsOf(withFewSteps(plain), sweptTolerances())) {
    if (explicit_only && method.stepper == StepperKind::kRadau) continue;
    const double most = allowed(method.tolerance);
    if (!std::isfinite(most)) continue;
    const test::Run run = play(method.scene, times);
    const std::string full = label + " " + method.name;
    hazard.compare(run, exact, method.scene, full, most, columns);
    // Rounding of the time and the angle in so steep a law may stop it, too.
    constexpr double kNoTolerance = 1e300;
    const bool is_rounded =
        run.reason == StopReason::kStepUnderflow && most > 1.005 * allowed(kNoTolerance);
    if (!is_rounded) expectNoStop(run, method.scene, full);
  }
}

// --- pulses of time ------------------------------------------------------------------------------

/// At 0.637, 1.637, ...: each changes the speed by 1 (or by 1e-3, below what the estimates of loose
/// tolerances could see), with nothing or a cosine between them.
TEST(Pulses, OfTime) {
  Hazard hazard("inside a step", "pulses of time under max, min and abs",
                "half widths 1e-1 to 1e-7 of the period, orders 0 to 3");
  const int n = 3;
  const double first = 0.637;
  const std::vector<double> times = {0.2, 1.137, 2.137, 3.137, 4.0};
  for (const char* principle : kPrinciples) {
    for (const Shape& shape : kShapes) {
      for (double width : widths()) {
        for (int order = 0; order <= 3; order += sizeOf(2, 1)) {
          for (double base : {0.0, 1.0}) {
            for (double size : {1.0, -1e-3}) {
              const double J = gearInertia(order);
              const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
                const double passed = std::max(0.0, std::min<double>(n, std::floor(t - first) + 1));
                sample.velocity[0] = 0.3 + (base * std::sin(t) + size * passed) / J;
                sample.acceleration[0] = base * std::cos(t) / J;
                writeGear(order, sample);
              });
              const std::string torque = exactly(base) + "*cos(t)+" +
                                         exactly(size / (shape.area * width)) + "*" +
                                         pulses(shape, "t", first, width, n);
              const std::string label = std::string(principle) + " " + shape.name + ", width " +
                                        text(width) + ", size " + text(size) + ", base " +
                                        text(base) + ", order " + std::to_string(order);
              // Edges are known to rounding of the time.
              compareAll(
                  hazard,
                  withPrinciple(gearText(order, {"q on a: " + torque}, 0.3, base / J), principle),
                  exact, times, label, [&](double tolerance) {
                    return kAllowed + 40.0 * kEps * n * std::abs(size) / width / tolerance;
                  });
            }
          }
        }
      }
    }
  }
}

// --- pulses of the angle -------------------------------------------------------------------------

/// At angles 0.5, 1.5, ...: each changes w^2 by `part` of its first value.
TEST(Pulses, OfAngle) {
  Hazard hazard("inside a step", "pulses of the angle under max, min and abs",
                "half widths 1e-1 to 1e-7 of the period");
  const int n = 4;
  const double w0 = 3.0;
  for (const Shape& shape : kShapes) {
    for (double width : widths()) {
      for (double part : {0.5, -0.2, 1e-4}) {
        // w^2 = w0^2 (1 + part (pulses passed)): in the middle between two at middle[i]
        std::vector<double> speed;
        std::vector<double> middle;
        std::vector<double> angle;
        double t = 0.0;
        for (int i = 0; i <= n; ++i) {
          const double w = w0 * std::sqrt(1.0 + part * i);
          // from the end of the last pulse (or the start) to the middle, and to the next one
          const double flat = i == 0 ? 0.5 - width : 0.5 * (1.0 - 2.0 * width);
          if (i > 0) {
            speed.push_back(w);
            middle.push_back(t + flat / w);
            angle.push_back(static_cast<double>(i));
            t = middle.back();
          }
          t += flat / w;
          const auto slowness = [&](double x) {
            return width / (w0 * std::sqrt(1.0 + part * (i + shape.integral(x) / shape.area)));
          };
          for (double from : {-1.0, -0.75, 0.0, 0.75}) {
            const double to = from == -1.0 ? -0.75 : from == -0.75 ? 0.0 : from == 0.0 ? 0.75 : 1.0;
            t += integrate(slowness, from, to, 8);
          }
        }
        const double growth = part < 0.0 ? 1.0 / (1.0 + part * n) : 1.0;
        for (const char* principle : kPrinciples) {
          for (int order : {0, 2}) {
            if (!isLongForm() && order > 0 && part > 0.0) continue;
            const double J = gearInertia(order);
            test::Run exact;
            for (std::size_t i = 0; i < middle.size(); ++i) {
              Sample sample;
              sample.time = middle[i];
              sample.angle[0] = angle[i];
              sample.velocity[0] = speed[i];
              sample.acceleration[0] = 0.0;
              if (order > 0) sample.angle[1] = 0.5 * sample.angle[0];
              writeGear(order, sample);
              exact.samples.push_back(sample);
            }
            const std::string torque = exactly(0.5 * J * w0 * w0 * part / (shape.area * width)) +
                                       "*" + pulses(shape, "phi1", 0.5, width, n);
            const std::string label = std::string(principle) + " " + shape.name + ", width " +
                                      text(width) + ", part " + text(part) + ", order " +
                                      std::to_string(order);
            // The work of a pulse is known to rounding of the angle over its width; what is wrong
            // at its edges by a tolerance of the angle cancels, for both edges are.
            compareAll(
                hazard, withPrinciple(gearText(order, {"q on a: " + torque}, w0), principle), exact,
                middle, label,
                [&](double tolerance) {
                  return growth * (kAllowed + 100.0 * kEps * std::abs(part) / width / tolerance);
                },
                Columns::kAll);
          }
        }
      }
    }
  }
}

// --- pairs of crossings that barely are ----------------------------------------------------------

struct Touch {
  const char* name;
  const char* drive;  ///< torque on a, of unit inertia
  const char* what;   ///< what touches
  double phi;         ///< initial angle and velocity of a
  double omega;
  double top;        ///< its largest value
  double curvature;  ///< -x'' there
  double at;         ///< s
};

/// x touches top - depth from below for 2 sqrt(2 depth/curvature) s; another shaft gets an impulse
/// of 1 by it.
TEST(Pulses, Touches) {
  Hazard hazard("inside a step", "two crossings that barely are: time, angle, velocity",
                "depths 1e-2 to 1e-8");
  // All x are parabolas, so that the impulse 4/3 depth (2 depth/curvature)^(1/2) is exact.
  const Touch touches[] = {
      {"time", "0", "(-(t-1.37)^2)", 0.0, 0.0, 0.0, 2.0, 1.37},
      {"velocity", "1-2*t", "w1", 0.0, 0.0, 0.25, 2.0, 0.5},
      {"angle", "-2", "phi1", -0.4, 1.6, 0.24, 2.0, 0.8},
      {"velocity and time", "1", "(w1-t^2)", 0.0, 0.0, 0.25, 2.0, 0.5},
  };
  const std::vector<double> depths =
      isLongForm() ? std::vector<double>{1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}
                   : std::vector<double>{1e-2, 1e-5, 1e-8};
  for (const char* principle : kPrinciples) {
    for (const Touch& touch : touches) {
      for (double depth : depths) {
        const double half = std::sqrt(2.0 * depth / touch.curvature);
        const std::vector<double> times = {touch.at + half + 0.1, 2.0, 2.9};
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          sample.velocity[1] = 1.0;
          const std::string drive = touch.drive;
          if (drive == "1-2*t") {
            sample.velocity[0] = t - t * t;
            sample.acceleration[0] = 1.0 - 2.0 * t;
          } else if (drive == "-2") {
            sample.velocity[0] = 1.6 - 2.0 * t;
            sample.acceleration[0] = -2.0;
          } else if (drive == "1") {
            sample.velocity[0] = t;
            sample.acceleration[0] = 1.0;
          }
        });
        const std::string yaml =
            withPrinciple(test::sceneText("a 1, b 1",
                                          {"p on a: " + std::string(touch.drive),
                                           "q on b: " + exactly(0.75 / (depth * half)) + "*max(0," +
                                               touch.what + "-" + exactly(touch.top - depth) + ")"},
                                          "initial: {angle: [" + plainly(touch.phi) +
                                              ", 0], velocity: [" + plainly(touch.omega) + ", 0]}"),
                          principle);
        const std::string label =
            std::string(principle) + " " + touch.name + ", depth " + text(depth);
        // An error of x of one tolerance is one of the depth; one as large says nothing. All x are
        // polynomials that every method follows but for rounding; of time there is no error.
        const bool is_time = std::string(touch.name) == "time";
        // Speed and time take the same way, of which enclosures know nothing: right, but slow
        // (doc/evidence.md).
        const bool is_slow = std::string(touch.name) == "velocity and time";
        if (is_slow && depth < 1e-7) continue;
        compareAll(
            hazard, yaml, exact, times, label,
            [&](double tolerance) {
              if (!is_time && tolerance > 1e-2 * depth) return double(HUGE_VAL);
              return kAllowed * (is_time ? 1.0 : 1.0 + 1.5 * tolerance / depth / tolerance) +
                     10.0 * kEps / depth / tolerance;
            },
            Columns::kVelocityAndAcceleration, is_slow);
      }
    }
  }
}

// --- many crossings ------------------------------------------------------------------------------

/// abs(sin(z x)) of the time and of an angle that turns evenly: z/pi kinks a second, as weak as one
/// likes.
TEST(Pulses, ManyWithinAStep) {
  Hazard hazard("inside a step", "abs of a sine of time and angle: up to 1000 kinks per second",
                "z = 3 to 3000 rad/s, factors 1e-9 to 10");
  const std::vector<double> times = evenly(2.0, 7);
  const std::vector<double> frequencies = isLongForm()
                                              ? std::vector<double>{3, 10, 31.4, 100, 300, 3000}
                                              : std::vector<double>{3, 31.4, 300};
  const std::vector<double> factors = isLongForm() ? std::vector<double>{1e-9, 1e-6, 1e-3, 0.1, 10}
                                                   : std::vector<double>{1e-6, 0.1, 10};
  for (const char* principle : kPrinciples) {
    for (double z : frequencies) {
      for (double K : factors) {
        for (const char* of : {"t", "phi2"}) {
          for (int order : {0, 2}) {
            // b turns evenly beside a gear of a, or alone
            if (order == 2 && of[0] == 'p') continue;
            const double J = gearInertia(order);
            const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
              const double half_waves = std::floor(z * t / kPi);
              const double rest = z * t - half_waves * kPi;
              sample.velocity[0] = K * (2.0 * half_waves + 1.0 - std::cos(rest)) / z / J;
              sample.acceleration[0] = K * std::abs(std::sin(rest)) / J;
              if (of[0] == 'p') sample.velocity[1] = 1.0;
              writeGear(order, sample);
            });
            const std::string torque =
                "q on a: " + exactly(K) + "*abs(sin(" + exactly(z) + "*" + of + "))";
            const std::string yaml =
                of[0] == 't' ? gearText(order, {torque})
                             : sceneText("a 1.5, b 1", {torque}, "initial: {velocity: [0, 1]}");
            compareAll(hazard, withPrinciple(yaml, principle), exact, times,
                       std::string(principle) + " z " + text(z) + ", K " + text(K) + ", of " + of +
                           ", order " + std::to_string(order),
                       [&](double tolerance) {
                         // Each kink is one of the many steps whose errors add up.
                         return kAllowed + z + 10.0 * kEps * z * K / tolerance;
                       });
          }
        }
      }
    }
  }
}

// --- tables --------------------------------------------------------------------------------------

/// The integral of a table's curve through (0, 0), (h, 1), (2 h, 0), over h: what the points alone
/// make of it (a trapezoid), less what the curvature -2/h^2 at the top takes.
constexpr double kTableArea = 1.0 - 2.0 * 2.0 / 120.0;

/// A pulse in a table of three points (an odd number of kinks), or of two such pulses (an even
/// one), narrower than any step: jerks over time, order 3; and after it nothing.
TEST(Tables, OfJerksFromRest) {
  Hazard hazard("inside a step", "tables of jerks over time, from rest",
                "points 1e-1 to 1e-5 s apart, one and two pulses");
  for (const char* principle : kPrinciples) {
    for (double h : {0.3, 1e-1, 1e-2, 1e-3, 1e-5}) {
      for (double start : {0.4, 3.3, 7.77}) {
        for (int n : {1, 2}) {
          std::string instants;
          std::string values;
          for (int i = 0; i <= 2 * n; ++i) {
            instants += (i == 0 ? "" : ", ") + plainly(start + i * h);
            values += i == 0 ? "0" : i % 2 == 1 ? ", 10" : ", 0";
          }
          const std::vector<double> times = {0.5 * start, start + 2.0 * n * h + 0.3, 11.0, 12.0};
          const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
            if (t <= start) return;
            // The curvature of a valley between two pulses gives back what that of a top takes.
            sample.acceleration[0] = 10.0 * h * (n - 1 + kTableArea);
            sample.velocity[0] = sample.acceleration[0] * (t - start - n * h);
          });
          compareAll(hazard,
                     withPrinciple(test::sceneText(
                                       "a 1, b 1",
                                       {std::string("j = ImposedJerk, shaft: a, jerk: {times: [") +
                                        instants + "], values: [" + values + "]}"}),
                                   principle),
                     exact, times,
                     std::string(principle) + " h " + text(h) + " at " + text(start) + ", " +
                         std::to_string(n) + " pulses",
                     [&](double tolerance) { return kAllowed + 100.0 * kEps * 10.0 / tolerance; });
        }
      }
    }
  }
}

/// A ratio over time that rises and falls back within a step (order 1, imposed on a driven shaft):
/// w2 = i(t) w1 with a heavy drive, and nothing is left of the pulse behind it. Angles keep it.
TEST(Tables, OfARatio) {
  Hazard hazard("inside a step", "a ratio's table over time: a pulse of three points",
                "points 1e-1 to 1e-5 s apart");
  for (const char* principle : kPrinciples) {
    for (double h : {0.3, 1e-1, 1e-2, 1e-3, 1e-5}) {
      for (double start : {0.4, 3.3}) {
        const std::vector<double> times = {0.5 * start, start + 2.0 * h + 0.3, 5.0};
        // Without torques the kinetic energy is kept by `gauss`, and where the ratio comes back so
        // do the speeds; under the generalized principle R has to come back too.
        const double height = 0.3;
        const double w0 = 2.0;
        const double J1 = 1e6;  // so that w1 stays at w0 to 1e-6 of itself
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          sample.velocity[0] = w0;
          sample.velocity[1] = 0.5 * w0;
          sample.angle[0] = w0 * t;
          sample.angle[1] = 0.5 * w0 * t + (t > start ? height * h * kTableArea * w0 : 0.0);
        });
        compareAll(
            hazard,
            withPrinciple(
                test::sceneText("a " + plainly(J1) + ", b",
                                {"k = KinematicRatio, shafts: [a, b], ratio: {times: [" +
                                 plainly(start) + ", " + plainly(start + h) + ", " +
                                 plainly(start + 2.0 * h) + "], values: [0.5, 0.8, 0.5]}"},
                                "b: {inertia: 1e-6}\ninitial: {velocity: [2, 1]}"),
                principle),
            exact, times, std::string(principle) + " h " + text(h) + " at " + text(start),
            [&](double tolerance) {
              return kAllowed / h + (1e-11 + 100.0 * kEps / h / h) / tolerance;
            },
            Columns::kAll);
      }
    }
  }
}

/// The same of a motor's curve over the speed: the speed runs through a narrow pulse while it rises
/// evenly. The time that it takes less is exact by an integral over the speed.
TEST(Tables, OfAMotorOverSpeed) {
  Hazard hazard("inside a step", "a motor's table over the speed: points close together",
                "points 1e-1 to 1e-6 of the speed apart");
  const double J = 1.5;
  for (const char* principle : kPrinciples) {
    for (double h : {0.2, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6}) {
      for (double height : {0.5, 20.0}) {
        // J w' = 1 + T(w), T between v - h and v + h
        const double v = 1.3;
        const auto table = [&](double x) {  // quintic through (0, 0), slope 0, curvature 0; (1, 1),
                                            // slope 0, curvature -2
          const double y = std::abs(x) < 1.0 ? 1.0 - std::abs(x) : 0.0;
          return y * y * y * (10.0 + y * (-15.0 + 6.0 * y)) -
                 2.0 * 0.5 * y * y * y * (1.0 - y) * (1.0 - y);
        };
        const double passing =
            2.0 * h * J *
            integrate([&](double x) { return 1.0 / (1.0 + height * table(x)); }, 0.0, 1.0);
        const double saved = 2.0 * h * J - passing;
        const std::vector<double> times = {0.5, J * (v + h) + 0.1, 3.0, 4.0};
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          sample.velocity[0] = (t > J * (v - h) ? t + saved : t) / J;
          sample.acceleration[0] = 1.0 / J;
        });
        compareAll(
            hazard,
            withPrinciple(
                test::sceneText(
                    "a 1.5", {"m = MotorCurve, shaft: a, characteristic: table, table: {speed: [" +
                                  plainly(v - h) + ", " + plainly(v) + ", " + plainly(v + h) +
                                  "], torque: [0, " + plainly(height) + ", 0], beyond: constant}",
                              "q on a: 1"}),
                principle),
            exact, times, std::string(principle) + " h " + text(h) + ", height " + text(height),
            [&](double /*tolerance*/) { return kAllowed * (1.0 + height); });
      }
    }
  }
}

/// ImposedJerk from rest, at instants and for durations of no regularity: before it nothing moves,
/// half of the change is done in the middle, all of it at the end. (Later the error of the
/// acceleration, which is relative to its largest value, goes on with the time.)
TEST(FromRest, ImposedJerks) {
  Hazard hazard("inside a step", "an imposed jerk from rest", "random starts and durations");
  std::mt19937 generator(20240521);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const int n = sizeOf(12, 200);
  for (int i = 0; i < n; ++i) {
    const double start = 20.0 * uniform(generator);
    const double duration = std::pow(10.0, -4.0 + 5.0 * uniform(generator));
    const double change = std::pow(10.0, -3.0 + 5.0 * uniform(generator));
    const std::vector<double> times = {0.5 * start, start, start + 0.5 * duration,
                                       start + 1.1 * duration, start + 2.0 * duration};
    const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
      sample.velocity[0] = t <= start ? 0.0 : t < start + duration ? 0.5 * change : change;
    });
    for (const char* principle : kPrinciples) {
      compareAll(
          hazard,
          withPrinciple(
              test::sceneText("a 1, b 1",
                              {"j = ImposedJerk, shaft: a, velocity_change: " + plainly(change) +
                               ", duration: " + plainly(duration) + ", start: " + plainly(start)}),
              principle),
          exact, times,
          std::string(principle) + " " + text(change) + " in " + text(duration) + " s from " +
              plainly(start),
          // The middle and the end are known to rounding of the time.
          [&](double tolerance) {
            return kAllowed + 100.0 * kEps * (start + duration) * change / duration / duration /
                                  std::max(1e-300, tolerance) * std::max(duration, 1.0);
          },
          Columns::kVelocity);
    }
  }
}

// --- opaque switches -------------------------------------------------------------------------

/// A depth that no formula tells.
class Depth : public OpaqueFunction {
 public:
  explicit Depth(double at) : OpaqueFunction(1), at_(at) {}
  double value(const double* x) const override { return x[0] - at_; }
  void calcGradient(const double* /*x*/, double* gradient) const override { gradient[0] = 1.0; }

 private:
  double at_;
};

/// A stop that pushes back by `stiffness` times the depth, or by as much at once, by an opaque
/// function.
class Stop : public Torque {
 public:
  Stop(double at, double stiffness, bool jumps) : at_(at), stiffness_(stiffness), jumps_(jumps) {}

 private:
  void build(LawContext& scene) override {
    const Shaft shaft = scene.shaftAt(0);
    const Expression depth = scene.function(std::make_shared<Depth>(at_), {shaft.angle});
    const Expression push = jumps_ ? Expression(stiffness_) : stiffness_ * depth;
    scene.apply(shaft, -where(depth < 0.0, 0.0, push));
  }
  double at_;
  double stiffness_;
  bool jumps_;
};

/// A shaft flies at 1 rad/s, is in the stop for a moment, and flies back.
TEST(Pulses, OfPluginsSwitches) {
  Hazard hazard("inside a step", "a plugin's stop that is met and left", "for 1 s to 1e-4 s");
  const std::vector<double> times = {0.3, 2.5, 4.0};
  for (const char* principle : kPrinciples) {
    for (bool jumps : {false, true}) {
      for (double inside : {0.7, 0.1, 1e-2, 1e-3, 1e-4}) {
        const double at = 0.6180339;
        // half a period pi/sqrt(k), or 2 w/e
        const double stiffness = jumps ? 2.0 / inside : kPi * kPi / inside / inside;
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          sample.velocity[0] = t < at ? 1.0 : -1.0;
          sample.angle[0] = t < at ? t : at - (t - at - inside);
        });
        Scene plain = sceneFromText(
            withPrinciple(test::sceneText("a 1", {}, "initial: {velocity: [1]}"), principle));
        addTorque(plain, std::make_shared<Stop>(at, stiffness, jumps));
        for (const Method& method : methodsOf(withFewSteps(plain), sweptTolerances())) {
          const test::Run run = play(method.scene, times);
          const std::string label = std::string(principle) + (jumps ? " jump, " : " spring, ") +
                                    text(inside) + " s " + method.name;
          // An error of the acceleration in the spring is one of the velocity over frequency;
          // accelerations are as large as pi/inside.
          hazard.compare(run, exact, method.scene, label,
                         kAllowed * (1.0 + kPi / inside * (jumps ? 0.0 : 1.0)), Columns::kAll);
          // (Known: implicit steps may stop, by name, at a bend that is left within 0.1 ms.)
          const bool is_known = !jumps && inside < 1e-3 &&
                                run.reason == StopReason::kStepUnderflow &&
                                method.scene.solver.stepper == StepperKind::kAuto;
          if (!is_known) expectNoStop(run, method.scene, label);
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
