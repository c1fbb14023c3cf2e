/// Steps of commanded torques: tiny ones, huge ones, very many, two at one instant, onto branches
/// that cannot be reached, and the ramps whose limit they are.
#include "stress/methods.h"

namespace variator_sim::test {
namespace {

/// e1^2 + e2^2 = a^2 with equal inertias: e = a (cos theta, sin theta), and a step of the torque by
/// D (cos beta, sin beta) turns it by tan((theta - beta)/2) -> tan((theta - beta)/2) exp(-D/(a J)).
/// With constant torques theta does not change between steps.
struct Circle {
  double a = 2.0;
  double J = 1.5;
  double theta = 1.0;

  Scene scene(const std::string& hold = "hold: zero_order") const {
    return sceneFromText(
        "a " + plainly(J) + ", b " + plainly(J),
        {"m on a from m, " + hold, "n on b from n, " + hold, "k: e1^2+e2^2-" + exactly(a * a)},
        "initial: {acceleration: " + list({a * std::cos(theta), a * std::sin(theta)}) +
            ", project: true}");
  }
  double turn(double from, double D, double beta) const {
    const double half = 0.5 * (from - beta);
    // tan(half) e^-x without overflow
    return beta + 2.0 * std::atan2(std::sin(half) * std::exp(-0.5 * D / (a * J)),
                                   std::cos(half) * std::exp(0.5 * D / (a * J)));
  }
  /// The most that a difference of theta grows along the way: its equation is
  /// dtheta = -sin(theta - beta) dD/(a J), so the growth is |sin after / sin before| at the most of
  /// all parts of the way.
  double growth(double from, double D, double beta) const {
    const double before = std::abs(std::sin(from - beta));
    const double after = std::abs(std::sin(turn(from, D, beta) - beta));
    // In between |sin| may pass through 1 where theta - beta passes a right angle.
    const bool passes = std::cos(from - beta) * std::cos(turn(from, D, beta) - beta) < 0.0;
    return std::max(1.0, (passes ? 1.0 : after) / std::max(before, 1e-300));
  }
};

Run motion(const Circle& circle, const std::vector<double>& times,
           const std::vector<std::pair<double, double>>& turns) {
  // (instant, theta from there on); accelerations are constant in between
  return tabulate(times, [&](double t, Sample& sample) {
    double theta = circle.theta;
    double from = 0.0;
    for (int i = 0; i < 2; ++i) sample.velocity[i] = 0.0;
    const auto go = [&](double to) {
      sample.velocity[0] += circle.a * std::cos(theta) * (to - from);
      sample.velocity[1] += circle.a * std::sin(theta) * (to - from);
      from = to;
    };
    for (const auto& [instant, after] : turns) {
      if (instant > t) break;
      go(instant);
      theta = after;
    }
    go(t);
    sample.acceleration[0] = circle.a * std::cos(theta);
    sample.acceleration[1] = circle.a * std::sin(theta);
  });
}

/// One step of 1e-6 to 1e6 N m, up or down.
TEST(Jumps, SizeOfTheStep) {
  Hazard hazard("jumps", "size of a torque step on a nonlinear psi",
                "1e-6 to 1e6 N m, up and down");
  const std::vector<double> times = evenly(1.0, 10);
  const double instant = 0.45;
  const std::vector<double> angles =
      isLongForm() ? std::vector<double>{-3.0, -2.0, -1.0, -0.1, 0.01, 0.5, 1.0, 1.57, 2.5, 3.1}
                   : std::vector<double>{-2.0, 0.01, 1.0, 2.5};
  for (double theta : angles) {
    Circle circle;
    circle.theta = theta;
    const Scene plain = circle.scene();
    for (int exponent = -6; exponent <= 6; exponent += sizeOf(3, 1)) {
      for (double sign : {1.0, -1.0}) {
        for (int input = 0; input < 2; ++input) {
          const double D = sign * std::pow(10.0, exponent);
          const double beta = input == 0 ? 0.0 : std::acos(0.0);
          const test::Run exact = motion(circle, times, {{instant, circle.turn(theta, D, beta)}});
          const double allowed = kAllowed * circle.growth(theta, D, beta);
          for (const Method& method : methodsOf(plain, sweptTolerances())) {
            // Many steps along the path of the jump, the same under every stepper by name.
            const bool is_own =
                method.stepper == StepperKind::kAuto || method.stepper == StepperKind::kFehlberg78;
            if (!isLongForm() && exponent == 6 && !is_own) continue;
            const test::Run run = play(method.scene, times, {{instant, input, D}});
            const std::string label = "theta = " + text(theta) + ", step of " + text(D) +
                                      " on shaft " + std::to_string(input + 1) + " " + method.name;
            hazard.compare(run, exact, method.scene, label, allowed);
            // If the growth allows any error, the circle remains as the only condition.
            if (run.reason == StopReason::kNone && allowed * method.tolerance > 0.1) {
              const double* e = run.samples.back().acceleration;
              hazard.judge(std::abs(std::hypot(e[0], e[1]) - circle.a) / (3.0 * method.tolerance),
                           label + ", radius");
            }
          }
        }
      }
    }
  }
  EXPECT_EQ(hazard.stops(), 0) << "the circle is reached from everywhere";
}

/// A step at every tick: n steps that take the direction to and fro, each exact.
TEST(Jumps, StepAtEveryTick) {
  Hazard hazard("jumps", "steps at every tick", "10 to 10000 steps of 1e-3 to 30 N m");
  const std::vector<int> counts =
      isLongForm() ? std::vector<int>{10, 100, 1000, 10000} : std::vector<int>{10, 300};
  for (int n : counts) {
    for (double size : {1e-3, 0.3, 30.0}) {
      Circle circle;
      circle.theta = 1.2;
      std::vector<TimedCommand> commands;
      std::vector<std::pair<double, double>> turns;
      double theta = circle.theta;
      double u[2] = {};
      // How errors at each step grow to the end; they all add up.
      double growth = 1.0;
      double worst = 1.0;
      for (int i = 1; i <= n; ++i) {
        const double t = static_cast<double>(i) / (n + 1);
        const int input = i % 2;
        const double value = size * std::sin(0.7 * i * i);
        const double beta = input == 0 ? 0.0 : std::acos(0.0);
        const double D = value - u[input];
        u[input] = value;
        const double before = std::sin(theta - beta);
        theta = circle.turn(theta, D, beta);
        // an error at any place so far is carried on by sin after / sin before
        growth = std::max(1.0, growth) * std::abs(std::sin(theta - beta) / before);
        worst = std::max(worst, growth);
        commands.push_back({t, input, value});
        turns.emplace_back(t, theta);
      }
      const std::vector<double> times = evenly(1.0, 16);
      const test::Run exact = motion(circle, times, turns);
      const Scene plain = circle.scene();
      Asked asked;
      asked.commands = commands;
      // n jumps, each good to a tenth of a tolerance
      compareMethods(hazard, plain, exact, std::to_string(n) + " steps of " + text(size), asked,
                     (kAllowed + 0.1 * n) * worst);
    }
  }
}

/// Two steps at one instant: together along one straight line, in whatever order they come.
TEST(Jumps, TwoAtOneInstant) {
  Hazard hazard("jumps", "two steps at one instant", "in both orders, 1e-3 to 1e3 N m");
  const std::vector<double> times = evenly(1.0, 10);
  for (double theta : {-2.0, 0.3, 1.0, 2.0}) {
    Circle circle;
    circle.theta = theta;
    for (int exponent = -3; exponent <= 3; exponent += sizeOf(2, 1)) {
      for (double ratio : {-2.0, 0.5, 1.0}) {
        const double m = std::pow(10.0, exponent);
        const double n = ratio * m;
        for (bool swapped : {false, true}) {
          Asked asked;
          asked.commands = {{0.5, 0, m}, {0.5, 1, n}};
          if (swapped) std::swap(asked.commands[0], asked.commands[1]);
          const double after = circle.turn(theta, std::hypot(m, n), std::atan2(n, m));
          const double growth = circle.growth(theta, std::hypot(m, n), std::atan2(n, m));
          const Scene plain = circle.scene();
          const test::Run exact = motion(circle, times, {{0.5, after}});
          compareMethods(hazard, plain, exact,
                         "theta = " + text(theta) + ", steps of " + text(m) + ", " + text(n) +
                             (swapped ? " (second first)" : ""),
                         asked, kAllowed * growth);
        }
      }
    }
  }
}

/// psi linear in the accelerations: one exact projection whatever the size, orders 1 and 2, both
/// principles. e2 = r e1 with a free third shaft; the exact response to a step is known.
TEST(Jumps, LinearConstraint) {
  Hazard hazard("jumps", "size of a torque step on a gear", "1e-6 to 1e6 N m, orders 1 to 3");
  const std::vector<double> times = evenly(1.0, 10);
  const double r = -0.4;
  const double effective = 1.5 + 0.8 * r * r;
  for (const char* principle : kPrinciples) {
    for (int order = 1; order <= 3; ++order) {
      const Scene plain =
          sceneFromText("a 1.5, b 0.8", {"m on a from m", "k" + ofOrder(order, "_2+0.4*_1")},
                        std::string("principle: ") + principle);
      for (int exponent = -6; exponent <= 6; exponent += sizeOf(3, 1)) {
        const double D = std::pow(10.0, exponent);
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          const double e = t >= 0.45 ? D / effective : 0.0;
          sample.acceleration[0] = e;
          sample.acceleration[1] = r * e;
          sample.velocity[0] = e * std::max(0.0, t - 0.45);
          sample.velocity[1] = r * sample.velocity[0];
        });
        Asked asked;
        asked.commands = {{0.45, 0, D}};
        compareMethods(
            hazard, plain, exact,
            std::string(principle) + " order " + std::to_string(order) + ", step of " + text(D),
            asked);
      }
    }
  }
}

/// A curve e2 = f(e1) from a start along which a step D of the torque on shaft a moves the
/// accelerations: J1 e1' + J2 f'(e1)^2 e1' = D, so P(e1) = D with P = int J1 + J2 f'^2 de1.
struct Curve {
  const char* expression;
  double start;                 ///< e1
  double low;                   ///< least e1 that there is
  double high;                  ///< greatest
  double (*f)(double e1);       ///< e2
  double (*passed)(double e1);  ///< P, 0 at the start
};

constexpr double kJ1 = 1.5;
constexpr double kJ2 = 0.8;
constexpr double kFar = 1e9;

const Curve kCurves[] = {
    // Ends that take a torque without bound to come near to.
    {"e2-1+sqrt(1-e1^2)", 0.0, -1.0, 1.0, [](double x) { return 1.0 - std::sqrt(1.0 - x * x); },
     [](double x) { return kJ1 * x + kJ2 * (std::atanh(x) - x); }},
    {"e2-log(1-e1)", 0.0, -kFar, 1.0, [](double x) { return std::log(1.0 - x); },
     [](double x) { return kJ1 * x + kJ2 * x / (1.0 - x); }},
    {"e2-tan(e1)", 0.0, -1.5707963267948966, 1.5707963267948966,
     [](double x) { return std::tan(x); },
     [](double x) {
       const double y = std::tan(x);
       return kJ1 * x + kJ2 * (y + y * y * y / 3.0);
     }},
    {"e2+asin(e1)", 0.0, -1.0, 1.0, [](double x) { return -std::asin(x); },
     [](double x) { return kJ1 * x + kJ2 * std::atanh(x); }},
    // Ends that are reached: a border of the domain where C is regular, and a cusp where C = 0.
    {"e2-1+(1-e1)^1.5", 0.0, -kFar, 1.0, [](double x) { return 1.0 - std::pow(1.0 - x, 1.5); },
     [](double x) { return kJ1 * x + 2.25 * kJ2 * (x - 0.5 * x * x); }},
    {"e2^2-e1^3", 1.0, 0.0, kFar, [](double x) { return std::pow(x, 1.5); },
     [](double x) { return kJ1 * (x - 1.0) + 2.25 * kJ2 * 0.5 * (x * x - 1.0); }},
    // No end: f has maximum and minimum on the way.
    {"e1^3-3*e1-e2", 0.0, -kFar, kFar, [](double x) { return x * x * x - 3.0 * x; },
     [](double x) {
       return kJ1 * x + 9.0 * kJ2 * (x - 2.0 / 3.0 * x * x * x + 0.2 * std::pow(x, 5));
     }},
};

/// Steps towards ends of the curve: those that pass it stop by name, all others are right.
TEST(Jumps, BranchThatCannotBeReached) {
  Hazard hazard("jumps", "steps towards the ends of constraint curves",
                "7 curves, 1e-2 to 1e6 N m, up and down");
  const std::vector<double> times = {0.2, 0.5, 0.7, 1.0};
  for (const Curve& curve : kCurves) {
    const double e2 = curve.f(curve.start);
    const Scene plain =
        sceneFromText("a 1.5, b 0.8", {"m on a from m", std::string("k: ") + curve.expression},
                      "initial: {acceleration: " + list({curve.start, e2}) + "}");
    for (double sign : {1.0, -1.0}) {
      for (int exponent = -2; exponent <= 6; exponent += sizeOf(2, 1)) {
        const double D = sign * std::pow(10.0, exponent);
        const double end = sign > 0.0 ? curve.high : curve.low;
        const bool reachable = std::abs(curve.passed(end)) > std::abs(D);
        double near = curve.start;
        double far = end;
        for (int i = 0; i < 2000 && reachable; ++i) {
          const double middle = 0.5 * (near + far);
          (std::abs(curve.passed(middle)) < std::abs(D) ? near : far) = middle;
        }
        const double after[2] = {near, curve.f(near)};
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          const double before[2] = {curve.start, e2};
          for (int i = 0; i < 2; ++i) {
            sample.acceleration[i] = t >= 0.5 ? after[i] : before[i];
            sample.velocity[i] = before[i] * std::min(t, 0.5) + after[i] * std::max(0.0, t - 0.5);
          }
        });
        // An error along the curve grows as P' = J1 + J2 f'^2 falls, here by at most
        // (J1 + 9 J2)/J1; one of e1 is f' times that in e2, which is of the size of P itself.
        const double slope =
            reachable ? std::abs((curve.f(near) - curve.f(near - 1e-6 * (near - curve.start))) /
                                 (1e-6 * (near - curve.start)))
                      : 0.0;
        const double allowed = kAllowed * 6.0 * std::max(1.0, std::min(slope, 1e4));
        for (const Method& method : methodsOf(plain, {1e-4, 1e-8})) {
          const test::Run run = play(method.scene, times, {{0.5, 0, D}});
          const std::string label =
              std::string(curve.expression) + ", step of " + text(D) + " " + method.name;
          if (reachable) {
            hazard.compare(run, exact, method.scene, label, allowed);
          } else {
            hazard.stopped(run.reason, label);
          }
          if (run.reason != StopReason::kNone) {
            EXPECT_DOUBLE_EQ(run.end, 0.5) << label << ": " << run.message;
          }
        }
      }
    }
  }
  EXPECT_GT(hazard.stops(), 0);
}

/// Ramps of width h tend to the jump, first order in h, down to widths near the resolution of time.
TEST(Jumps, RampsTendToTheJump) {
  Hazard hazard("jumps", "ever faster ramps against the jump map", "widths 1e-1 to 1e-9 s");
  const double D = 7.0;
  for (double theta : {1.0, 2.0, -2.5}) {
    Circle circle;
    circle.theta = theta;
    const double after = circle.turn(theta, D, 0.0);
    const double growth = circle.growth(theta, D, 0.0);
    for (int decade = 1; decade <= 9; decade += sizeOf(2, 1)) {
      const double h = std::pow(10.0, -decade);
      const std::vector<double> times = {0.5 + 2.0 * h, 1.0};
      for (const std::string& hold : {"hold: rate_limit, rate: " + plainly(D / h),
                                      "hold: first_order_hold, period: " + plainly(h)}) {
        const Scene plain = circle.scene(hold);
        // On this scene the direction after the ramp is that after the jump exactly; the velocities
        // differ by what the direction is behind during the ramp.
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          const double kappa = D / h;
          const auto during = [&](double x) { return circle.turn(theta, kappa * x, 0.0); };
          for (int i = 0; i < 2; ++i) {
            const auto e = [&](double angle) {
              return circle.a * (i == 0 ? std::cos(angle) : std::sin(angle));
            };
            sample.velocity[i] = e(theta) * 0.5 +
                                 integrate([&](double x) { return e(during(x)); }, 0.0, h) +
                                 e(after) * (t - 0.5 - h);
            sample.acceleration[i] = e(after);
          }
        });
        for (const Method& method : methodsOf(plain, sweptTolerances())) {
          const test::Run run = play(method.scene, times, {{0.5, 0, D}});
          const std::string label = "theta = " + text(theta) + ", " + hold + " " + method.name;
          // 0.5 + h is known to 1.1e-16 s: the ramp's width to 2.2e-16 / h of itself.
          const double rounding = 2.3e-16 / h * D / (circle.a * circle.J) / method.tolerance;
          // (The growth is that of small errors: a tenth more for others.)
          hazard.compare(run, exact, method.scene, label, 1.1 * (kAllowed + rounding) * growth);
          if (rounding < 1.0) {
            EXPECT_EQ(run.reason, StopReason::kNone) << label << ": " << run.message;
          }
        }
        // First order: the velocity at the end of a ramp differs from that after a jump by about h.
        const test::Run jumped = motion(circle, times, {{0.5, after}});
        for (int i = 0; i < 2; ++i) {
          EXPECT_LE(std::abs(exact.samples[1].velocity[i] - jumped.samples[1].velocity[i]),
                    2.0 * circle.a * h);
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
