/// Long lives: short ramps and lags at late times, formulas of a late time, lockstep that begins
/// late, and quantities that nothing may move however long it takes.
#include "stress/methods.h"

namespace variator_sim::test {
namespace {

// --- short ramps and lags at late times ----------------------------------------------------------

/// How u gets from 0 to 1 after a command: its value and its integral, x seconds after.
struct Hold {
  std::string keys;
  double (*value)(double x, double width);
  double (*integral)(double x, double width);
};

std::vector<Hold> holds(double width) {
  const auto ramp = [](double x, double T) { return std::min(1.0, x / T); };
  const auto ramp_integral = [](double x, double T) {
    return x < T ? 0.5 * x * x / T : x - 0.5 * T;
  };
  return {
      {"hold: rate_limit, rate: " + plainly(5.0 / width), ramp, ramp_integral},
      {"hold: first_order_hold, period: " + plainly(width), ramp, ramp_integral},
      {"hold: first_order_lag, time_constant: " + plainly(width),
       [](double x, double T) { return -std::expm1(-x / T); },
       [](double x, double T) { return x + T * std::expm1(-x / T); }},
      {"hold: second_order_lag, time_constant: " + plainly(width),
       [](double x, double T) { return -std::expm1(-x / T) - x / T * std::exp(-x / T); },
       [](double x, double T) { return x + 2.0 * T * std::expm1(-x / T) + x * std::exp(-x / T); }},
  };
}

/// The gear turns evenly until the command, or rests; `t` is in a law in some, so that the time
/// counts.
TEST(LongLives, ShortRampsAtLateTimes) {
  Hazard hazard("long lives", "ramps and lags after a late command",
                "rates to 5e16 N m/s, lags 1e-3 to 1e-15 s, at 0.9 to 1e7 s");
  const double J = gearInertia(1);
  const double u = 5.0;
  const std::vector<double> instants =
      isLongForm() ? std::vector<double>{0.9, 33.3, 1000.3, 54321.1, 1e6, 1e7}
                   : std::vector<double>{0.9, 1000.3, 1e7};
  const std::vector<double> widths =
      isLongForm() ? std::vector<double>{1e-2,  1e-3,  1e-4,  1e-6,  1e-8, 1e-9,
                                         1e-10, 1e-12, 1e-13, 1e-15, 1e-16}
                   : std::vector<double>{1e-3, 1e-9, 1e-12, 1e-15, 1e-20};
  for (const char* principle : kPrinciples) {
    for (double instant : instants) {
      for (double width : widths) {
        for (const Hold& hold : holds(width)) {
          for (int order = 1; order <= 3; order += sizeOf(2, 1)) {
            for (int form = 0; form < 3; ++form) {
              const double w0 = form == 0 ? 0.0 : 1.0;
              const bool reads_time = form == 2;
              // 1e7 s of steps of at most 1 s
              if (form > 0 && instant > 2e3 && !(isLongForm() && instant < 1e5)) continue;
              const std::vector<double> times = {instant + 0.01, instant + 0.1, instant + 0.6};
              const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
                const double x = t - instant;
                sample.velocity[0] = w0 + u * hold.integral(x, width) / J;
                sample.acceleration[0] = u * hold.value(x, width) / J;
                writeGear(order, sample);
              });
              const Scene plain = sceneFromText(gearText(order,
                                                         {"c on a from m, " + hold.keys,
                                                          reads_time ? "q on b: 0*t" : "q on b: 0"},
                                                         w0) +
                                                "principle: " + principle);
              Asked asked;
              asked.stops = Stops::kKnown;
              asked.commands = {{instant, 0, u}};
              // Instants count from the command: nothing is lost to the time's own rounding, but
              // what the velocity before it has collected. A ramp below the resolution of the time
              // is a jump.
              const bool is_jump = width < kEps * instant;
              compareMethods(hazard, withFewSteps(plain), exact,
                             std::string(principle) + " " + hold.keys + " at " + plainly(instant) +
                                 ", order " + std::to_string(order) +
                                 (form == 0    ? " from rest"
                                  : reads_time ? " reads t"
                                               : ""),
                             asked, [&](double tolerance) {
                               return kAllowed + (form == 0 ? 0.0 : 1e-14 * instant / tolerance) +
                                      (is_jump ? 2.0 * u * width / J / tolerance : 0.0);
                             });
            }
          }
        }
      }
    }
  }
}

/// A slip behind a commanded drive, with a brake; `is_curved`: psi is nonlinear in the
/// accelerations.
Scene slipScene(const std::string& drive, const std::string& brake, bool is_curved,
                const std::string& principle) {
  return sceneFromText("a 1, b 2",
                       {"c on a from m, " + drive, "f on b: " + brake,
                        std::string("v: 0.2*(e2-0.6*e1)") +
                            (is_curved ? "*(1+0.05*(e1^2+e2^2))" : "") + "+w2-0.6*w1"},
                       "principle: " + principle);
}

/// The same command at any time of a scene at rest gives the same motion, bit for bit, where the
/// instants are exact.
TEST(LongLives, TheSameCommandAtAnyTime) {
  Hazard hazard("long lives", "the same command at other times, to 1e-10",
                "2^-10 to 2^24 s, every hold");
  // (An edge of a law is looked for to the resolution of the time itself.)
  Hazard bent("long lives", "the same with a law that is bent at a speed", "2^-10 to 2^24 s");
  const std::vector<double> after = {0.0009765625, 0.125, 0.25, 1.5};
  std::vector<std::string> all = {"hold: zero_order"};
  for (double width : {1e-2, 1e-6, 1e-12}) {
    for (const Hold& hold : holds(width)) all.push_back(hold.keys);
  }
  for (const char* principle : kPrinciples) {
    for (const std::string& keys : all) {
      for (int form = 0; form < 4; ++form) {
        const bool is_bent = form > 1;
        const Scene plain =
            slipScene(keys, is_bent ? "-max(0,w2-0.1)" : "-0.3*w2", form % 2 == 1, principle);
        for (StepperKind stepper : steppersOf(plain)) {
          const Scene scene = withSolver(withFewSteps(plain), stepper, 1e-8);
          test::Run first;
          for (double instant : {0.0009765625, 1024.0, 16777216.0}) {
            std::vector<double> times;
            for (double x : after) times.push_back(instant + x);
            const test::Run run = play(scene, times, {{instant, 0, 5.0}});
            const std::string label = std::string(principle) + " " + keys + " " +
                                      std::to_string(form) + " at " + plainly(instant) + " " +
                                      toString(stepper);
            expectNoStop(run, scene, label);
            if (first.samples.empty()) {
              first = run;
              continue;
            }
            // Ends of segments are rounded to the time, edges are looked for to its resolution.
            const double rounding = 10.0 * kEps * instant / 1e-8;
            // Steps by stages have another first one where the time does not resolve a form.
            const bool is_by_series =
                stepper == StepperKind::kAuto || stepper == StepperKind::kTaylor;
            (is_bent ? bent : hazard)
                .compare(run, first, scene, label,
                         (is_bent        ? kAllowed
                          : is_by_series ? 1e-2
                                         : 1.0) +
                             rounding);
          }
        }
      }
    }
  }
}

// --- formulas of a late time ---------------------------------------------------------------------

/// A sine of t + late as a torque, as psi of orders 1 and 2. Its argument is known to a rounding:
/// its value then to that times the frequency.
TEST(LongLives, FormulasOfALateTime) {
  Hazard hazard("long lives", "sines of a late time in torques and psi",
                "offsets 0 to 1e7 s, orders 1 and 2");
  const std::vector<double> times = evenly(10.0, 9);
  const std::vector<double> offsets = isLongForm() ? std::vector<double>{0, 1e2, 1e4, 5e4, 1e6, 1e7}
                                                   : std::vector<double>{0, 5e4, 1e7};
  for (const char* principle : kPrinciples) {
    for (double late : offsets) {
      for (double z : {0.7, 6.0}) {
        for (double size : {1.0, 1e3}) {
          for (int place = 0; place < 3; ++place) {  // torque, order 2, order 1
            const auto phase = [&](double t) {
              return static_cast<double>(
                  std::fmod(static_cast<long double>(z) *
                                (static_cast<long double>(t) + static_cast<long double>(late)),
                            2.0L * 3.14159265358979323846264338327950288L));
            };
            const std::string sine =
                exactly(size) + "*sin(" + exactly(z) + "*(t+" + exactly(late) + "))";
            const double at_start = size * std::sin(phase(0.0));
            const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
              const double way = size * (std::cos(phase(0.0)) - std::cos(phase(t))) / z;
              const double now = size * std::sin(phase(t));
              sample.velocity[0] = place == 2 ? now : way;
              sample.acceleration[0] = place == 2 ? size * z * std::cos(phase(t)) : now;
              if (place == 0) {
                sample.velocity[1] = t;
                sample.acceleration[1] = 1.0;
              }
            });
            const Scene plain = sceneFromText(
                "a 1, b 0.8",
                {"q on a: " + (place == 0 ? sine : "0"),
                 place == 0 ? "k: e2-1" : "k" + ofOrder(place == 2 ? 1 : 2, "_1-" + sine)},
                "initial: {velocity: " + list({place == 2 ? at_start : 0.0, 0.0}) +
                    ", project: true}\nprinciple: " + principle);
            for (const Method& method : methodsOf(withFewSteps(plain), sweptTolerances())) {
              const test::Run run = play(method.scene, times);
              const std::string label = std::string(principle) + " " + sine + ", place " +
                                        std::to_string(place) + " " + method.name;
              // Both the argument's sum and its product are rounded.
              const double rounding = 2.0 * kEps * (late + 10.0) * z;
              const double steep = size * std::max(1.0, place == 2 ? z : 1.0 / z);
              hazard.compare(run, exact, method.scene, label,
                             kAllowed + 20.0 * rounding * steep / method.tolerance);
              // (More rounding of a constraint than that may stop it by name.)
              if (rounding * size < 100.0 * method.tolerance)
                expectNoStop(run, method.scene, label);
            }
          }
        }
      }
    }
  }
}

/// A slip whose ratio is a sine of a late time, at speed: against the same with the phase written
/// out, early.
TEST(LongLives, RatiosOfALateTime) {
  Hazard hazard("long lives", "a slip whose ratio is a sine of a late time, at 2000 rad/s",
                "offsets 1e2 to 1e7 s");
  const std::vector<double> times = evenly(10.0, 5);
  const std::vector<double> offsets =
      isLongForm() ? std::vector<double>{1e2, 1e4, 5e4, 1e6, 1e7} : std::vector<double>{5e4, 1e7};
  for (const char* principle : kPrinciples) {
    for (double late : offsets) {
      const auto sceneWith = [&](const std::string& sine) {
        const std::string ratio = "(0.6+0.2*" + sine + ")";
        return withFewSteps(sceneFromText(
            "a 0.8, b 2",
            {"m on a: 60-0.02*w1", "p on b: -0.00002*w2^2",
             "v: 0.2*(e2-" + ratio + "*e1) + w2-" + ratio + "*w1"},
            std::string("initial: {velocity: [2000, 1200]}\nprinciple: ") + principle));
      };
      const double phase = static_cast<double>(
          std::fmod(static_cast<long double>(0.7) * static_cast<long double>(late),
                    2.0L * 3.14159265358979323846264338327950288L));
      const test::Run reference = play(withSolver(sceneWith("sin(0.7*t+" + exactly(phase) + ")"),
                                                  StepperKind::kFehlberg78, 1e-12),
                                       times);
      ASSERT_EQ(reference.reason, StopReason::kNone) << reference.message;
      const Scene plain = sceneWith("sin(0.7*(t+" + exactly(late) + "))");
      for (const Method& method : methodsOf(plain, sweptTolerances())) {
        const test::Run run = play(method.scene, times);
        const std::string label =
            std::string(principle) + " late " + text(late) + " " + method.name;
        // An argument's rounding changes psi by 0.2 w1 times that, and the accelerations by 1/tau
        // of it; relative to those and to the speeds:
        const double rounding = kEps * 0.7 * late;
        hazard.compare(run, reference, method.scene, label,
                       kAllowed + 100.0 * rounding / method.tolerance);
        expectNoStop(run, method.scene, label);
        // The projection is moved by more than the tolerance then: that is told, and stops nothing.
        if (method.stepper == StepperKind::kAuto) {
          EXPECT_EQ(run.reason, StopReason::kNone) << label << ": " << run.message;
          if (late == 1e7 && method.tolerance < 1e-8 &&
              method.scene.principle == Principle::kGeneralizedGauss) {
            EXPECT_GT(run.statistics.largest_rounding, 1.0) << label;
          }
        }
      }
    }
  }
}

// --- neutral modes -------------------------------------------------------------------------------

/// The null-space component of the reaction keeps its start value: 0 on a free shaft, c2 R1 - c1 R2
/// beside a gear, for any torques.
TEST(LongLives, NeutralModesDoNotDrift) {
  Hazard hazard("long lives", "reactions that no constraint can change, in tolerances",
                "to 3e3 s, 1e5 s in the long form");
  Hazard motion("long lives", "a damped swing under both principles, differences of tolerances",
                "to 3e3 s, 1e5 s in the long form");
  const double end = sizeOf(3e3, 1e5);
  const std::vector<double> times = evenly(end, 5);
  struct Form {
    const char* name;
    const char* shafts;
    int order;  ///< of the gear; 0: none
    const char* initial;
    double (*calc)(const double* R);  ///< what stays
  };
  const auto of_gear = [](const double* R) { return R[0] + 0.5 * R[1]; };
  const Form forms[] = {
      {"free shaft", "a 1", 0, "", [](const double* R) { return R[0]; }},
      {"gear, order 2", "a 1, b 2", 2, "", of_gear},
      {"gear, order 1", "a 1, b 2", 1, "", of_gear},
      {"gear, order 3, started off range(C^T)", "a 1, b 2", 3, "acceleration: [0.1, 0.2]", of_gear},
      {"gear beside a third shaft", "a 1, b 2, c 3", 2, "acceleration: [0.2, 0.1, 0.05]",
       [](const double* R) { return R[2]; }},
  };
  for (const Form& form : forms) {
    const bool is_free = form.order == 0;
    std::vector<std::string> elements = {"q on a: sin(t)-0.1*w1-0.02*w1^3"};
    if (!is_free) elements.push_back("k" + ofOrder(form.order, "_2-0.5*_1"));
    const Scene plain =
        sceneFromText(form.shafts, elements, "initial: {" + std::string(form.initial) + "}");
    test::Run reference;
    if (is_free) {
      Scene tight = withSolver(withFewSteps(plain), StepperKind::kFehlberg78, 1e-12);
      tight.principle = Principle::kGauss;
      reference = play(tight, times);
    }
    for (const Method& method : methodsOf(withFewSteps(plain), {1e-4, 1e-8})) {
      Simulation simulation(method.scene);
      const double start = form.calc(simulation.sample().reaction_torque);
      const test::Run run = play(method.scene, times);
      const std::string label = std::string(form.name) + " " + method.name;
      expectNoStop(run, method.scene, label);
      double most = 0.0;
      for (const Sample& sample : run.samples) {
        most = std::max(most, std::abs(form.calc(sample.reaction_torque) - start));
      }
      // A sample lies inside of a step, where R is known to its error; drift would add them up.
      hazard.judge(most / method.tolerance, label, 10.0);
      if (is_free) motion.compare(run, reference, method.scene, label);
    }
  }
}

// --- lockstep that begins late -------------------------------------------------------------------

/// Ticks of 1 ms, a command at each, that begin after 1e7 s of rest, against the same from 0 with
/// the same differences of instants.
TEST(LongLives, LockstepThatBeginsLate) {
  Hazard exact("long lives", "lockstep of 2^-10 s that begins at 2^23 s",
               "all holds, a command at each tick");
  Hazard close("long lives", "lockstep of 1 ms that begins at 1e7 s",
               "all holds, a command at each tick");
  const int ticks = sizeOf(60, 5000);
  const std::string all[] = {"hold: zero_order", "hold: first_order_hold, period: 0.001",
                             "hold: rate_limit, rate: 400",
                             "hold: first_order_lag, time_constant: 0.002",
                             "hold: second_order_lag, time_constant: 0.002"};
  for (const char* principle : kPrinciples) {
    for (const std::string& keys : all) {
      for (int form = 0; form < 4; form += sizeOf(3, 1)) {
        const bool is_bent = form > 1;
        const Scene plain = slipScene("timeout: 0.5, " + keys,
                                      is_bent ? "-0.3*w2-0.1*abs(w2)*w2" : "-0.3*w2-0.1*w2^3",
                                      form % 2 == 1, principle);
        for (const Method& method : methodsOf(withFewSteps(plain), {1e-6, 1e-9})) {
          if (!isLongForm() && method.tolerance > 1e-8) continue;
          for (bool is_exact : {true, false}) {
            const double begin = is_exact ? 8388608.0 : 1e7;
            const double tick = is_exact ? 0.0009765625 : 0.001;
            std::vector<double> late;
            std::vector<double> early;
            std::vector<TimedCommand> late_commands;
            std::vector<TimedCommand> early_commands;
            for (int n = 1; n <= ticks; ++n) {
              late.push_back(begin + n * tick);
              early.push_back(late.back() - begin);  // exact
              const double value = 3.0 + 2.0 * std::sin(0.05 * n) + (n % 7 == 0 ? 1.0 : 0.0);
              late_commands.push_back({late.back(), 0, value});
              early_commands.push_back({early.back(), 0, value});
            }
            const test::Run a = play(method.scene, late, late_commands);
            const test::Run b = play(method.scene, early, early_commands);
            const std::string label = std::string(principle) + " " + keys + " " +
                                      std::to_string(form) + " " + method.name;
            EXPECT_EQ(a.reason, StopReason::kNone) << label << ": " << a.message;
            EXPECT_EQ(b.reason, StopReason::kNone) << label << ": " << b.message;
            // (Ramps end where the time is rounded to.)
            const bool is_ramp = keys.find("rate_limit") != std::string::npos;
            (is_exact ? exact : close)
                .compare(a, b, method.scene, label,
                         is_exact && !is_bent && !is_ramp ? 1.0 : kAllowed);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
