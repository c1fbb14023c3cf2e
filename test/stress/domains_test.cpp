/// Motions that leave the domain of their formulas, escape in finite time or turn back, and plugins
/// that fail now and then.
#include <stdexcept>

#include "stress/methods.h"

namespace variator_sim::test {
namespace {

Scene oneShaft(const std::string& principle, const std::string& torque, double w0) {
  return sceneFromText(gearText(0, {"q on a: " + torque}, w0) + "principle: " + principle);
}

// --- finite escape time --------------------------------------------------------------------------

/// J w' = k w^n escapes at T = J w0^(1-n) / (k (n-1)): w = w0 (1 - t/T)^(-1/(n-1)). A sample near T
/// magnifies an error of T: the growth of w' over w is 1/((n-1)(T - t)).
TEST(Domains, FiniteEscape) {
  Hazard hazard("domains", "finite escape time", "w^1.5 to w^5, k = 1e-3 to 1e3, to T (1 - 1e-6)");
  const std::vector<double> powers =
      isLongForm() ? std::vector<double>{1.5, 2, 2.5, 3, 4, 5} : std::vector<double>{1.5, 2, 4};
  const std::vector<double> factors = isLongForm()
                                          ? std::vector<double>{1e-3, 1e-2, 0.1, 1, 10, 100, 1e3}
                                          : std::vector<double>{1e-2, 1, 1e3};
  for (const char* principle : kPrinciples) {
    for (double n : powers) {
      for (double k : factors) {
        const double w0 = 1.3;
        const double J = 1.5;
        const double T = J * std::pow(w0, 1.0 - n) / (k * (n - 1.0));
        const Scene plain = oneShaft(principle, exactly(k) + "*w1^" + exactly(n), w0);
        // One instant a run: each is judged by its own growth.
        for (double part : {0.3, 0.9, 0.99, 0.9999, 0.999999, 1.5}) {
          const std::vector<double> times = {part * T};
          for (const Method& method : methodsOf(plain, sweptTolerances())) {
            const test::Run run = play(method.scene, times);
            const std::string label = std::string(principle) + " " + text(k) + " w^" + text(n) +
                                      " to " + text(part) + " T " + method.name;
            // So near that T itself is not known well enough: nothing is asked there.
            if (part < 1.0 && kAllowed * method.tolerance * n > 1.0 - part) continue;
            if (part > 1.0) {
              hazard.stopped(run.reason, label);
              EXPECT_LE(run.end, T * (1.0 + kAllowed * method.tolerance)) << label;
              EXPECT_GE(run.end, T * (1.0 - kAllowed * method.tolerance) - 1e-3 * T) << label;
              continue;
            }
            const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
              sample.velocity[0] = w0 * std::pow(1.0 - t / T, -1.0 / (n - 1.0));
              sample.acceleration[0] = k * std::pow(sample.velocity[0], n) / J;
            });
            // A relative error d of w at any time moves T by (n - 1)(T - t) d or less, and that
            // comes back as d n/(1 - part) in w' at the most (errors of earlier steps weigh
            // less).
            hazard.compare(run, exact, method.scene, label, kAllowed * n / (1.0 - part));
          }
        }
      }
    }
  }
}

/// It stops by name, and what was before `end` is right.
void judgeStop(Hazard& hazard, Run run, const Run& exact, double end, const Method& method,
               const std::string& label) {
  while (!run.samples.empty() && run.samples.back().time >= end) run.samples.pop_back();
  hazard.judge(calcDifference(run, exact, 2, method.tolerance, method.tolerance), label);
  hazard.stopped(run.reason, label);
}

// --- turning points ------------------------------------------------------------------------------

/// Under `gauss` a constraint (e1 - f)^2 + ... that folds: e2 = sqrt(1 - e1^2) as a circle, with a
/// torque that rotates: the accelerations go round (no fold for the principle). And a true fold:
/// e1^3 - 3 e1 + p t = 0 in one acceleration: at t* = 2/p the branch that starts at e1 = -... ends.
TEST(Domains, TurningPoint) {
  Hazard hazard("domains", "branch that turns back", "psi = e1^3 - 3 e1 - p t, p = 1e-3 to 1e3");
  // From e1 = 0: e1^3 - 3 e1 = p t... e1 falls to -1 at p t = 2 and there is no way on.
  const auto branch = [](double x) {  // of e^3 - 3 e = x, |x| <= 2, the middle one
    return -2.0 * std::sin(std::asin(0.5 * x) / 3.0);
  };
  const std::vector<double> speeds = isLongForm()
                                         ? std::vector<double>{1e-3, 1e-2, 0.1, 1, 10, 100, 1e3}
                                         : std::vector<double>{1e-3, 1, 1e3};
  for (const char* principle : kPrinciples) {
    for (double p : speeds) {
      const double end = 2.0 / p;
      const Scene plain = sceneFromText(
          "a 1.5, b 0.8", {"k: e1^3-3*e1-" + exactly(p) + "*t"},
          std::string("principle: ") + principle + "\ninitial: {acceleration: [0, 0]}");
      for (double part : {0.5, 0.9, 0.999, 1.5}) {
        const std::vector<double> times = evenly(part * end, 8);
        for (const Method& method : methodsOf(plain, sweptTolerances())) {
          Scene scene = method.scene;
          scene.solver.maximum_steps = 20000;  // none of these needs so many in a second
          const test::Run run = play(scene, times);
          const std::string label = std::string(principle) + " p = " + text(p) + " to " +
                                    text(part) + " of it " + method.name;
          const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
            if (t >= end) return;
            sample.acceleration[0] = branch(p * t);
            sample.velocity[0] = integrate([&](double x) { return branch(p * x); }, 0.0, t, 400);
          });
          if (part < 1.0) {
            // psi is kept, so e1 is no worse than rounding makes it.
            hazard.compare(run, exact, scene, label);
            continue;
          }
          judgeStop(hazard, run, exact, end, method, label);
          // If psi turns back like a square, t errs by the square of e1's error.
          EXPECT_LE(run.end, end * (1.0 + 1e-9 + method.tolerance * method.tolerance))
              << label << ": " << run.message;
          EXPECT_GE(run.end, 0.99 * end) << label << ": " << run.message;
        }
      }
    }
  }
}

// --- leaving the domain --------------------------------------------------------------------------

/// psi or a torque as a function of t that ends at T = 1: e1 = f(t) or J e1 = f(t).
TEST(Domains, RootsLogsAndPoles) {
  Hazard hazard("domains", "roots, logs and poles in psi and torques",
                "13 functions that end at a time");
  struct Case {
    const char* formula;        ///< of t; T is 0.817
    double (*value)(double t);  ///< the same
    bool bounded;               ///< no infinity comes near
  };
  static constexpr double T = 0.817;
  const Case cases[] = {
      {"sqrt(0.817-t)", [](double t) { return std::sqrt(T - t); }, true},
      {"(0.817-t)^1.5", [](double t) { return std::pow(T - t, 1.5); }, true},
      {"(0.817-t)^2.5", [](double t) { return std::pow(T - t, 2.5); }, true},
      {"(0.817-t)^4.5", [](double t) { return std::pow(T - t, 4.5); }, true},
      {"(0.817-t)^8.5", [](double t) { return std::pow(T - t, 8.5); }, true},
      {"log(0.817-t)", [](double t) { return std::log(T - t); }, false},
      {"(0.817-t)*log(0.817-t)", [](double t) { return (T - t) * std::log(T - t); }, true},
      {"(0.817-t)^3*log(0.817-t)", [](double t) { return std::pow(T - t, 3) * std::log(T - t); },
       true},
      {"asin(t/0.817)", [](double t) { return std::asin(t / T); }, true},
      {"1/(0.817-t)", [](double t) { return 1.0 / (T - t); }, false},
      {"0.01/(0.817-t)^2", [](double t) { return 0.01 / ((T - t) * (T - t)); }, false},
      {"0.1/sqrt(0.817-t)", [](double t) { return 0.1 / std::sqrt(T - t); }, false},
      {"tan(1.5707963267948966*t/0.817)",
       [](double t) { return std::tan(1.5707963267948966 * t / T); }, false},
  };
  const std::vector<double> times = {0.2, 0.4, 0.6, 0.7, 0.8, 0.81, 0.9, 1.2};
  for (const char* principle : kPrinciples) {
    for (const Case& function : cases) {
      for (int place = 0; place < 3; ++place) {
        // As a torque of a free shaft, as psi that imposes e1, as the coefficient of another row.
        const std::string f = function.formula;
        const std::string torque = place == 0 ? "1.5*(" + f + ")" : "0";
        const std::string psi = place == 0   ? "e2-cos(t)"
                                : place == 1 ? "e1-(" + f + ")"
                                             : "(3+t)*(e1-(" + f + "))";
        const double before = function.value(0.0);
        const Scene plain = sceneFromText(
            "a 1.5, b 0.8", {"q on a: " + torque, "k: " + psi},
            std::string("principle: ") + principle +
                "\ninitial: {acceleration: " + list({before, place == 0 ? 1.0 : 0.0}) + "}");
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          if (t >= T) return;
          sample.acceleration[0] = function.value(t);
          sample.velocity[0] = integrate(function.value, 0.0, t, 2000);
          if (place == 0) {
            sample.acceleration[1] = std::cos(t);
            sample.velocity[1] = std::sin(t);
          }
        });
        for (const Method& method : methodsOf(plain, sweptTolerances())) {
          const test::Run run = play(method.scene, times);
          const std::string label = std::string(principle) + " " +
                                    (place == 0 ? "torque " + torque : psi) + " " + method.name;
          judgeStop(hazard, run, exact, T, method, label);
          EXPECT_LE(run.end, T * (1.0 + 1e-12)) << label << ": " << run.message;
          EXPECT_GE(run.end, 0.81) << label << ": " << run.message;
        }
      }
    }
  }
}

/// A pole that is stepped across has finite values on both sides: 1/(T - t) for t > T.
TEST(Domains, PolesAreNotSteppedAcross) {
  Hazard hazard("domains", "poles with finite values behind",
                "strength 1e-9 to 1, orders 1 to 3 of the pole");
  const double T = 0.817;
  const std::vector<double> times = {0.4, 0.8, 0.9, 1.2};
  for (const char* principle : kPrinciples) {
    for (int decade = -9; decade <= 0; decade += sizeOf(3, 1)) {
      for (int order = 1; order <= 3; ++order) {
        const double c = std::pow(10.0, decade);
        const std::string f = exactly(c) + "/(0.817-t)^" + std::to_string(order);
        const Scene plain = oneShaft(principle, "1.5*" + f, 0.0);
        for (const Method& method : methodsOf(plain, sweptTolerances())) {
          Scene scene = method.scene;
          // A pulse of a formula in t is seen where it is wider than solver/maximum_step
          // (doc/scene.md): wherever this one is 100 tolerances of the acceleration high. Under
          // gauss a step sees what that makes of the velocity, 500 tolerances * width at the
          // most.
          const double width = 2.0 * std::pow(c / (kAllowed * method.tolerance), 1.0 / order);
          const bool is_state = std::string(principle) == "generalized_gauss";
          if (width < (is_state ? sizeOf(0.3, 0.01) : 0.3)) continue;
          scene.solver.maximum_step = std::min(1.0, 0.2 * width);
          const test::Run run = play(scene, times);
          const std::string label = std::string(principle) + " " + f + " " + method.name;
          // A pole that has moved no velocity by a tolerance within one step cannot be seen; what
          // it did is then judged: the principal value (order 1), or nothing at all.
          if (run.reason == StopReason::kNone) {
            const double t = 1.2;
            const double part =
                order == 1 ? c * std::log(T / (t - T)) : std::numeric_limits<double>::quiet_NaN();
            const double error = std::abs(run.samples.back().velocity[0] - part) /
                                 (method.tolerance * (1.0 + std::abs(part)));
            hazard.judge(error, label + " (it did not stop)");
            continue;
          }
          hazard.stopped(run.reason, label);
          EXPECT_LE(run.end, T * (1.0 + 1e-9)) << label << ": " << run.message;
        }
      }
    }
  }
}

// --- plugins that fail now and then --------------------------------------------------------------

/// The behaviour of a failing component at each n-th evaluation of one of its functions.
struct Fault {
  enum class Kind { kNan, kInfinity, kThrow } kind = Kind::kNan;
  int period = 0;  ///< 0: never
  int once = 0;    ///< the call that fails, if once only
  int calls = 0;

  bool strikes() {
    ++calls;
    return once > 0 ? calls == once : period > 0 && calls % period == 0;
  }
  double value() {
    if (kind == Kind::kThrow) throw std::runtime_error("the plugin has thrown");
    return kind == Kind::kNan ? std::numeric_limits<double>::quiet_NaN()
                              : std::numeric_limits<double>::infinity();
  }
};

/// x, with faults in its value and in its derivative.
class Faulty : public OpaqueFunction {
 public:
  Faulty(Fault* value, Fault* slope) : OpaqueFunction(1), value_(value), slope_(slope) {}
  double value(const double* x) const override {
    return value_->strikes() ? value_->value() : x[0];
  }
  void calcGradient(const double* /*x*/, double* gradient) const override {
    gradient[0] = slope_->strikes() ? slope_->value() : 1.0;
  }

 private:
  Fault* value_;
  Fault* slope_;
};

/// 2 cos(3 t) - 0.4 w1, with faults in Q and in Q'.
class FaultyTorque : public Torque {
 public:
  explicit FaultyTorque(Fault* faults) : faults_(faults) {}

 private:
  void build(LawContext& scene) override {
    const Shaft a = scene.shaftAt(0);
    const auto f = std::make_shared<Faulty>(faults_, faults_ + 1);
    scene.apply(a, 2.0 * cos(3.0 * scene.time()) - 0.4 * scene.function(f, {a.velocity}));
  }
  Fault* faults_;
};

/// 0.3 (e2 - 0.6 e1) + w2 - 0.6 w1, with faults in psi and in its derivatives.
class FaultyConstraint : public Constraint {
 public:
  explicit FaultyConstraint(Fault* faults) : faults_(faults) {}

 private:
  void build(LawContext& scene) override {
    const Shaft a = scene.shaftAt(0);
    const Shaft b = scene.shaftAt(1);
    const auto f = std::make_shared<Faulty>(faults_, faults_ + 1);
    scene.constrain(0.3 * (scene.function(f, {b.acceleration}) - 0.6 * a.acceleration) +
                    b.velocity - 0.6 * a.velocity);
  }
  Fault* faults_;
};

class FaultyFactory : public BuiltinComponentFactory {
 public:
  ConstraintPtr createConstraint(const std::string& type) override {
    if (type == "test/Faulty") return std::make_shared<FaultyConstraint>(faults + 2);
    return BuiltinComponentFactory::createConstraint(type);
  }
  TorquePtr createTorque(const std::string& type) override {
    if (type == "test/Faulty") return std::make_shared<FaultyTorque>(faults);
    return BuiltinComponentFactory::createTorque(type);
  }
  Fault faults[4];  ///< of Q, Q', psi, its derivatives
};

const char* const kFaultNames[] = {"torque", "torque rate", "residual", "partials"};

Scene faultyScene(FaultyFactory& factory, const std::string& principle) {
  return readScene(
      readYamlText("shafts: [a, b]\na: {inertia: 1.5}\nb: {inertia: 0.8}\ntorques: [q]\n"
                   "q: {type: test/Faulty}\nconstraints: [k]\nk: {type: test/Faulty}\n"
                   "verify_derivatives: false\nprinciple: " +
                       principle + "\ninitial: {velocity: [1, 0.6]}\n",
                   "test"),
      factory);
}

/// NaN or infinity, once or once in so many calls: survived by a shorter step, or a stop by name;
/// never in the motion, nor in a sample. `plans`: (period, call that fails if once only).
void sweepFaults(Hazard& hazard, const std::vector<std::pair<int, int>>& plans) {
  const std::vector<double> times = evenly(3.0, 30);
  for (const char* principle : kPrinciples) {
    FaultyFactory sound;
    const test::Run reference =
        play(withSolver(faultyScene(sound, principle), StepperKind::kFehlberg78, 1e-12), times);
    ASSERT_EQ(reference.samples.size(), times.size()) << reference.message;
    for (int place = 0; place < 4; ++place) {
      for (const Fault::Kind kind : {Fault::Kind::kNan, Fault::Kind::kInfinity}) {
        for (StepperKind stepper : steppersOf(faultyScene(sound, principle))) {
          for (double tolerance : sweptTolerances()) {
            for (const auto& [period, once] : plans) {
              FaultyFactory factory;
              Scene scene =
                  withFewSteps(withSolver(faultyScene(factory, principle), stepper, tolerance));
              factory.faults[place].kind = kind;
              factory.faults[place].period = period;
              factory.faults[place].once = once;
              factory.faults[place].calls = 0;
              const test::Run run = play(scene, times);
              const std::string label =
                  std::string(principle) + " " + (kind == Fault::Kind::kNan ? "NaN" : "infinity") +
                  " of the " + kFaultNames[place] +
                  (once > 0 ? " at call " + std::to_string(once)
                            : " at each " + std::to_string(period) + "th call") +
                  " " + describe(stepper, tolerance);
              hazard.compare(run, reference, scene, label);
              for (const Sample& sample : run.samples) {
                // Applied torques and reactions of a sample may be the fault's own, as they are
                // evaluated for it; the state may not.
                EXPECT_TRUE(std::isfinite(sample.angle[0]) && std::isfinite(sample.angle[1]))
                    << label;
              }
            }
          }
        }
      }
    }
  }
}

TEST(Domains, PluginsThatReturnNan) {
  Hazard hazard("domains", "plugins that return NaN or infinity",
                "once, at call 1 to 3000, or each 100th to 1000th call");
  std::vector<std::pair<int, int>> plans;
  for (int period : {100, 333, 1000}) plans.emplace_back(period, 0);
  const int step = sizeOf(266, 7);
  for (int once = 1; once < sizeOf(800, 3000); once += step) plans.emplace_back(0, once);
  sweepFaults(hazard, plans);
}

/// So often that hardly a step succeeds.
TEST(Domains, PluginsThatReturnNanOften) {
  Hazard hazard("domains", "plugins that return NaN or infinity often", "each 7th to 60th call");
  sweepFaults(hazard, {{7, 0}, {13, 0}, {31, 0}, {60, 0}});
}

/// A plugin's function that throws has no value there: the motion goes on right where a shorter
/// step avoids that, or stops by name, and runs right again after a reset.
TEST(Domains, PluginsThatThrow) {
  Hazard hazard("domains", "plugins that throw", "once, at call 1 to 3000");
  const std::vector<double> times = evenly(3.0, 30);
  int stopped = 0;
  for (const char* principle : kPrinciples) {
    FaultyFactory sound;
    const test::Run reference =
        play(withSolver(faultyScene(sound, principle), StepperKind::kFehlberg78, 1e-12), times);
    for (int place = 0; place < 4; ++place) {
      for (StepperKind stepper : steppersOf(faultyScene(sound, principle))) {
        for (int once = 1; once < sizeOf(800, 3000); once += sizeOf(157, 13)) {
          const std::string label = std::string(principle) + " " + kFaultNames[place] + ", call " +
                                    std::to_string(once) + " " + toString(stepper);
          FaultyFactory factory;
          const Scene scene = withSolver(faultyScene(factory, principle), stepper, 1e-7);
          factory.faults[place].kind = Fault::Kind::kThrow;
          factory.faults[place].once = once;
          factory.faults[place].calls = 0;
          std::unique_ptr<Simulation> simulation;
          try {
            simulation = std::make_unique<Simulation>(scene);
          } catch (const SceneError&) {
            ++stopped;
            hazard.named("refused at the start", label);
            continue;
          }
          const auto advance = [&](test::Run& run) {
            for (double time : times) {
              simulation->advanceTo(time);
              const Sample sample = simulation->sample();
              if (!simulation->status().ok()) break;
              run.samples.push_back(sample);
            }
            run.reason = simulation->status().reason;
          };
          test::Run first;
          ASSERT_NO_THROW(advance(first)) << label;
          hazard.compare(first, reference, scene, label);
          if (simulation->status().ok()) continue;
          ++stopped;
          simulation->reset();
          test::Run again;
          advance(again);
          hazard.compare(again, reference, scene, label + " after a reset");
          EXPECT_EQ(again.samples.size(), times.size()) << label;
        }
      }
    }
  }
  EXPECT_GT(stopped, 0);
}

}  // namespace
}  // namespace variator_sim::test
