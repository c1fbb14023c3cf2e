/// Laws that jump: a torque by the sign of a time, an angle or a speed, against motions put
/// together from smooth pieces and against the same steps by commands; laws that are crossed back
/// at once, which have no motion and have to say so at once; and constraints of order 1 with a
/// kink, whose accelerations jump.
#include "stress/methods.h"

namespace variator_sim::test {
namespace {

std::vector<double> sizes() {
  return isLongForm() ? std::vector<double>{1e-9, 1e-6, 1e-4, 1e-2, 0.1, 0.5, 0.9, 0.999}
                      : std::vector<double>{1e-6, 1e-2, 0.5, 0.999};
}

/// Motion with accelerations that are constant between jumps.
struct Pieces {
  double time;
  double angle;
  double velocity;
  double acceleration;
  void moveTo(double t) {
    const double h = t - time;
    angle += h * (velocity + 0.5 * h * acceleration);
    velocity += h * acceleration;
    time = t;
  }
  /// When the angle becomes `goal`, later than now; infinity when never.
  double reachesAngle(double goal) const {
    const double c = angle - goal;
    double best = HUGE_VAL;
    if (acceleration == 0.0) {
      best = -c / velocity;
    } else {
      const double root = velocity * velocity - 2.0 * acceleration * c;
      if (root < 0.0) return HUGE_VAL;
      // without cancellation
      const double q = -(velocity + std::copysign(std::sqrt(root), velocity));
      for (double h : {q / acceleration, 2.0 * c / q}) {
        if (h > 1e-9 && h < best) best = h;
      }
    }
    return best > 1e-9 ? time + best : HUGE_VAL;
  }
};

Run tabulatePieces(const std::vector<double>& times, int order, Pieces x,
                   const std::function<double(const Pieces&)>& next,
                   const std::function<double(const Pieces&)>& acceleration) {
  test::Run run;
  double jump = next(x);
  for (double time : times) {
    while (jump <= time) {
      x.moveTo(jump);
      x.acceleration = acceleration(x);
      jump = next(x);
    }
    x.moveTo(time);
    Sample sample;
    sample.time = time;
    sample.angle[0] = x.angle;
    sample.velocity[0] = x.velocity;
    sample.acceleration[0] = x.acceleration;
    writeGear(order, sample);
    run.samples.push_back(sample);
  }
  return run;
}

/// All steppers and tolerances; `free` is where reactions are counted: a shaft without constraints
/// has none, in roundings of the torque.
void compareAll(Hazard& hazard, Hazard* free, const std::string& yaml, const Run& exact,
                const std::vector<double>& times, const std::string& label, double growth,
                double rounding, double torque) {
  for (const char* principle : kPrinciples) {
    const Scene plain = sceneFromText(yaml + "principle: " + principle + "\n");
    for (const Method& method : methodsOf(withFewSteps(plain), sweptTolerances())) {
      const test::Run run = play(method.scene, times);
      const std::string full = std::string(principle) + " " + label + " " + method.name;
      hazard.compare(run, exact, method.scene, full,
                     kAllowed * growth + rounding / method.tolerance);
      expectNoStop(run, method.scene, full);
      if (free == nullptr || !method.scene.constraints.empty()) continue;
      double most = 0.0;
      for (const Sample& sample : run.samples) {
        most = std::max(most, std::abs(sample.reaction_torque[0]));
      }
      free->judge(most / (kEps * torque), full, 64.0);
    }
  }
}

TEST(LawJumps, OfTime) {
  Hazard hazard("jumps of laws", "sign of the time, once and as a square wave",
                "sizes 1e-9 to 1e6 of the torque beside it, orders 0 to 3");
  Hazard free("jumps of laws", "reaction of a free shaft after them, in roundings", "the same");
  const double a = 0.637;
  const std::vector<double> times = {0.3, 0.63, 0.64, 1.1, 2.3, 3.7};
  std::vector<double> ratios = sizes();
  for (double size : {1.0, 10.0, 1e3, 1e6}) ratios.push_back(size);
  for (int order = 0; order <= 3; ++order) {
    const double J = gearInertia(order);
    for (double K : ratios) {
      for (double drive : {1.0, 0.0}) {
        const std::string base = "q on a: " + exactly(drive) + "+" + exactly(K);
        const Pieces start = {0.0, 0.0, 0.4, (drive - K) / J};
        compareAll(
            hazard, &free,
            gearText(order, {base + "*sign(t-" + exactly(a) + ")"}, 0.4, (drive - K) / J),
            tabulatePieces(
                times, order, start,
                [&](const Pieces& x) { return x.time < a ? a : double(HUGE_VAL); },
                [&](const Pieces&) { return (drive + K) / J; }),
            times,
            "once, K " + text(K) + " drive " + text(drive) + ", order " + std::to_string(order),
            1.0, 10.0 * kEps * K, K + drive);
      }
      // between two instants of a wave of period 0.5 s; times are not its instants
      const double half = 0.25;
      const std::vector<double> between = {0.1, 0.3, 1.1, 2.3, 3.6};
      const Pieces start = {0.0, 0.0, 0.4, (1.0 + K) / J};
      compareAll(
          hazard, &free,
          gearText(order,
                   {"q on a: 1+" + exactly(K) + "*sign(sin(" + exactly(kPi / half) + "*(t+0.05)))"},
                   0.4, (1.0 + K) / J),
          tabulatePieces(
              between, order, start,
              [&](const Pieces& x) {
                return half * (std::floor((x.time + 0.05) / half + 1e-6) + 1.0) - 0.05;
              },
              [&](const Pieces& x) {
                const double n = std::floor((x.time + 0.05) / half + 1e-6);
                return (1.0 + (std::fmod(n, 2.0) == 0.0 ? K : -K)) / J;
              }),
          between, "square wave, K " + text(K) + ", order " + std::to_string(order), 1.0,
          200.0 * kEps * K, K + 1.0);
    }
  }
}

/// -1 - K sign(w1), from a positive speed through zero: at K < 1 it goes through.
TEST(LawJumps, OfASpeed) {
  Hazard hazard("jumps of laws", "sign of a speed that is driven through zero",
                "1e-9 to 0.999 of the drive, orders 0 to 3");
  Hazard free("jumps of laws", "reaction of a free shaft after it, in roundings", "the same");
  const std::vector<double> times = {0.3, 0.6, 1.1, 1.9, 3.7};
  for (int order = 0; order <= 3; ++order) {
    const double J = gearInertia(order);
    for (double K : sizes()) {
      const double w0 = 0.8;
      const double crossing = w0 * J / (1.0 + K);
      const Pieces start = {0.0, 0.0, w0, -(1.0 + K) / J};
      compareAll(
          hazard, &free,
          gearText(order, {"q on a: -1-" + exactly(K) + "*sign(w1)"}, w0, start.acceleration),
          tabulatePieces(
              times, order, start,
              [&](const Pieces& x) { return x.time < crossing ? crossing : HUGE_VAL; },
              [&](const Pieces&) { return -(1.0 - K) / J; }),
          times, "K " + text(K) + ", order " + std::to_string(order), 2.0, 10.0 * kEps * (1.0 + K),
          1.0 + K);
    }
  }
}

/// -1 - K sign(phi1 - 0.3): into the harder side and back again, and once more.
TEST(LawJumps, OfAnAngle) {
  Hazard hazard("jumps of laws", "sign of an angle, passed to and fro",
                "sizes 1e-9 to 100 of the drive, orders 0 to 3");
  Hazard free("jumps of laws", "reaction of a free shaft after it, in roundings", "the same");
  std::vector<double> ratios = sizes();
  for (double size : {1.0, 3.0, 100.0}) ratios.push_back(size);
  const double at = 0.3;
  const std::vector<double> times = evenly(4.0, 9);
  for (int order = 0; order <= 3; ++order) {
    const double J = gearInertia(order);
    for (double K : ratios) {
      // An oscillation where K > 1: of energy 1/2, in the end several passes.
      const Pieces start = {0.0, -0.1, 1.7, -(1.0 - K) / J};
      double passes = 0.0;
      double slowest = start.velocity;
      double steepest = (1.0 + K) / J;
      const test::Run exact = tabulatePieces(
          times, order, start, [&](const Pieces& x) { return x.reachesAngle(at); },
          [&](const Pieces& x) {
            passes += 1.0;
            slowest = std::min(slowest, std::abs(x.velocity));
            return -(x.velocity > 0.0 ? 1.0 + K : 1.0 - K) / J;
          });
      // At each pass an error of the angle is one of the instant and so of the velocity, by
      // 2 K/J over the speed; and grows on the way back and forth.
      const double growth = (1.0 + passes) * (1.0 + steepest / slowest) * 4.0;
      compareAll(hazard, &free,
                 gearText(order, {"q on a: -1-" + exactly(K) + "*sign(phi1-" + exactly(at) + ")"},
                          1.7, start.acceleration, -0.1),
                 exact, times, "K " + text(K) + ", order " + std::to_string(order), growth,
                 100.0 * growth * kEps, 1.0 + K);
    }
  }
}

// --- on constraints that are curved in the accelerations -----------------------------------------

const char* const kCurved[] = {
    "0.2*(e2-0.6*e1)*(1+0.05*(e1^2+e2^2))+w2-0.6*w1",
    "e2-0.5*e1-0.1*sin(e1)+0.3*(w2-0.5*w1)",
};

Scene curved(const char* psi, const std::string& torque, const char* principle) {
  return withFewSteps(
      sceneFromText("a 0.8, b 2", {"f on a: -0.2*w1", "q on a" + torque, std::string("k: ") + psi},
                    std::string("initial: {velocity: [3, 1]}\nprinciple: ") + principle));
}

/// The law has the effect of commands of the same size at the same instants.
TEST(LawJumps, AreCommandsAtTheirInstants) {
  Hazard hazard("jumps of laws", "on a curved psi: the same as by commands",
                "sizes 1e-3 to 30 N m, of time and speed");
  const std::vector<double> times = evenly(2.0, 7);
  for (const char* principle : kPrinciples) {
    for (const char* psi : kCurved) {
      for (double K : {1e-3, 0.3, 6.0, 30.0}) {
        for (int of = 0; of < 3; ++of) {  // the time once, many times, a speed
          const double before = of == 1 ? 2.0 + K : 2.0 - K;
          Scene tight = withSolver(curved(psi, " from u, initial: " + plainly(before), principle),
                                   StepperKind::kFehlberg78, 1e-13);
          tight.solver.sleep = false;
          std::vector<TimedCommand> commands;
          std::string law;
          if (of == 0) {
            commands = {{0.7, 0, 2.0 + K}};
            law = "2+" + exactly(K) + "*sign(t-0.7)";
          } else if (of == 1) {
            for (int n = 1; n * kPi / 7.0 < 2.0; ++n) {
              commands.push_back({n * kPi / 7.0, 0, n % 2 == 1 ? 2.0 - K : 2.0 + K});
            }
            law = "2+" + exactly(K) + "*sign(sin(7*(t+1e-300)))";
          } else {
            // b speeds up through 1.3 rad/s or not, with the torque of before
            Simulation search(tight);
            const double goal = 1.3;
            double low = 0.0;
            double high = 2.0;
            const auto isBeyond = [&](double t) {
              search.reset();
              return search.advanceTo(t).ok() && search.sample().velocity[1] > goal;
            };
            if (!isBeyond(high)) continue;
            for (int i = 0; i < 55; ++i)
              (isBeyond(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
            commands = {{high, 0, 2.0 + K}};
            law = "2+" + exactly(K) + "*sign(w2-1.3)";
          }
          const test::Run reference = play(tight, times, commands);
          if (reference.samples.size() != times.size()) continue;
          // (A motion that comes back to the speed is not the commanded one.)
          if (of == 2) {
            bool comes_back = false;
            for (const Sample& sample : reference.samples) {
              comes_back |= sample.time > commands[0].time && sample.velocity[1] <= 1.3;
            }
            if (comes_back) continue;
          }
          compareMethods(hazard, curved(psi, ": " + law, principle), reference,
                         std::string(principle) + " " + law + " on " + psi,
                         {sweptTolerances(), Stops::kKnown}, [&](double tolerance) {
                           // accelerations that change quickly where the speed is passed
                           return kAllowed * (of == 2 ? 1.0 + K : 1.0) + 1e-11 / tolerance;
                         });
        }
      }
    }
  }
}

// --- crossed back at once ------------------------------------------------------------------------

struct Sliding {
  std::string name;
  std::string yaml;
  double at;  ///< when it begins, s
  std::string culprit;
};

double solve(const std::function<double(double)>& f, double low, double high) {
  const bool rises = f(high) > 0.0;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    ((f(middle) > 0.0) == rises ? high : low) = middle;
  }
  return high;
}

TEST(LawJumps, CrossedBackAtOnceStops) {
  Hazard hazard("jumps of laws", "crossed back at once: the instant of the stop",
                "speeds, differences of speeds, moving edges, order 3");
  std::vector<Sliding> list;
  for (double drive : {0.0, 1.0, -4.0, 4.9, -4.999}) {
    for (int order = 0; order <= 3; ++order) {
      const double J = gearInertia(order);
      list.push_back(
          {"friction, drive " + text(drive) + ", order " + std::to_string(order),
           gearText(order, {"q on a: " + exactly(drive) + "-5*sign(w1)"}, 2.0, (drive - 5.0) / J),
           2.0 * J / (5.0 - drive), "torque 'q'"});
    }
  }
  for (double K : {0.1, 5.0, 1e3}) {
    list.push_back({"clutch " + text(K),
                    sceneText("a 1.5, b 0.8",
                              {"p on a: -" + exactly(K) + "*sign(w1-w2)",
                               "q on b: " + exactly(K) + "*sign(w1-w2)"},
                              "initial: {velocity: [0.3, 0.1]}"),
                    0.2 / (K / 1.5 + K / 0.8), "torque '"});
  }
  list.push_back({"a moving edge", gearText(0, {"q on a: -5*sign(w1-sin(t))"}, 2.0),
                  solve([](double t) { return std::sin(t) - (2.0 - t * 5.0 / 1.5); }, 0.0, 3.0),
                  "torque 'q'"});
  list.push_back({"a sliding line", gearText(0, {"q on a: -5*sign(w1+phi1)"}, 1.0, 0.0, 1.0),
                  // phi = 1 + t - (5/1.5) t^2/2
                  solve(
                      [](double t) {
                        const double e = 5.0 / 1.5;
                        return -(1.0 - e * t + 1.0 + t - 0.5 * e * t * t);
                      },
                      0.0, 3.0),
                  "torque 'q'"});
  list.push_back(
      {"order 3",
       sceneText("a 1, b 2", {"v of order 3: j2-5*sign(1-e2)"}, "initial: {acceleration: [0, 0]}"),
       0.2, "constraint 'v'"});
  int most = 0;
  std::string where;
  for (const Sliding& sliding : list) {
    for (const char* principle : kPrinciples) {
      if (sliding.name == "order 3" && principle[0] == 'g' && principle[1] == 'a') continue;
      const Scene plain = sceneFromText(sliding.yaml + "principle: " + principle + "\n");
      for (const Method& method : methodsOf(withFewSteps(plain), sweptTolerances())) {
        const test::Run run = play(method.scene, {sliding.at + 10.0});
        const std::string label = sliding.name + " " + principle + " " + method.name;
        // (An implicit stepper under `gauss` feels both sides in its Jacobian by differences.)
        const bool is_blurred =
            principle == std::string("gauss") && method.stepper == StepperKind::kRadau;
        if (run.reason != StopReason::kChattering) {
          if (!is_blurred) hazard.judge(HUGE_VAL, label + ": " + run.message);
          EXPECT_NE(run.reason, StopReason::kNone) << label;
          continue;
        }
        // It may cross to and fro a few times before it is sure.
        hazard.judge(std::abs(run.end - sliding.at) / method.tolerance, label,
                     kAllowed + (is_blurred ? 1e-3 : 1e-9) / method.tolerance);
        EXPECT_NE(run.message.find(sliding.culprit), std::string::npos) << run.message;
        const int steps = static_cast<int>(run.statistics.steps + run.statistics.rejected_steps);
        if (steps > most) {
          most = steps;
          where = label;
        }
      }
    }
  }
  EXPECT_LT(most, 3000) << "steps until it was told: " << where;
}

// --- kinks of order 1 ----------------------------------------------------------------------------

/// w2 = k |w1| and w2 = k max(0, w1), driven through w1 = 0 by an even torque: C turns at once. The
/// motion is the limit of smooth kinks of width d -> 0. There J1 + J2 c^2 =: m(c) with
/// f = w2 - c w1, and under the generalized principle e1 sqrt(m) stays as it is while c turns:
///     J1 e1' = -c Lambda,  J2 e2' = Lambda,  e2' = c e1' + c' e1  =>  m e1' = -J2 c c' e1.
/// Under `gauss` it is Q / m.
TEST(KinksOfOrder1, OfASpeedAreLimitsOfSmoothOnes) {
  Hazard hazard("jumps of laws", "order 1: abs and max of a speed, C turns", "ratios 0.01 to 3");
  Hazard smooth("jumps of laws", "order 1: smooth ones against their limit",
                "widths 1e-2 to 1e-6 rad/s");
  const double J1 = 1.5;
  const double J2 = 0.8;
  const double w0 = -0.9;
  const std::vector<double> times = {0.3, 0.7, 1.9, 2.4, 3.0};
  for (const char* principle : kPrinciples) {
    const bool remembers = principle[1] == 'e';
    for (double k : {0.01, 0.5, 3.0}) {
      for (bool is_abs : {true, false}) {
        const double m_before = is_abs ? J1 + k * k * J2 : J1;
        const double m_after = J1 + k * k * J2;
        const double before = 1.0 / m_before;
        const double after = remembers ? before * std::sqrt(m_before / m_after) : 1.0 / m_after;
        const double crossing = -w0 / before;
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          const bool is_after = t > crossing;
          const double w = is_after ? after * (t - crossing) : w0 + before * t;
          const double c = is_after ? k : is_abs ? -k : 0.0;
          sample.velocity[0] = w;
          sample.velocity[1] = c * w;
          sample.acceleration[0] = is_after ? after : before;
          sample.acceleration[1] = c * sample.acceleration[0];
        });
        const double c0 = is_abs ? -k : 0.0;
        const auto bentScene = [&](const std::string& bent, double velocity) {
          return sceneFromText(
              "a 1.5, b 0.8", {"q on a: 1", "k of order 1: w2-" + exactly(k) + "*" + bent},
              "initial: {velocity: " + list({w0, velocity}) + "}\nprinciple: " + principle);
        };
        const std::string what =
            std::string(principle) + (is_abs ? " abs" : " max") + ", k " + text(k);
        const Scene kinked = bentScene(is_abs ? "abs(w1)" : "max(0,w1)", c0 * w0);
        compareMethods(hazard, withFewSteps(kinked), exact, what, {sweptTolerances(), Stops::kAny},
                       kAllowed * (1.0 + k));
        for (double d : {1e-2, 1e-4, 1e-6}) {
          const double root = std::sqrt(w0 * w0 + d * d);
          const std::string bent = is_abs ? "sqrt(w1^2+" + exactly(d * d) + ")"
                                          : "(0.5*(w1+sqrt(w1^2+" + exactly(d * d) + ")))";
          const Scene scene =
              withSolver(withFewSteps(bentScene(bent, k * (is_abs ? root : 0.5 * (w0 + root)))),
                         StepperKind::kFehlberg78, 1e-9);
          smooth.compare(play(scene, times), exact, scene, what + ", width " + text(d),
                         kAllowed + 10.0 * (1.0 + k) * d / 1e-9);
        }
      }
    }
  }
}

/// w2 = 0.5 w1 + K |t - 0.637|: the acceleration that f' = 0 asks for jumps by 2 K.
TEST(KinksOfOrder1, OfTime) {
  Hazard hazard("jumps of laws", "order 1: abs and max of the time", "factors 1e-6 to 100");
  const double J1 = 1.5;
  const double J2 = 0.8;
  const double a = 0.637;
  const std::vector<double> times = {0.3, 0.63, 0.64, 1.9, 3.0};
  for (const char* principle : kPrinciples) {
    for (double K : {1e-6, 1e-3, 0.1, 1.0, 100.0}) {
      for (bool is_abs : {true, false}) {
        const test::Run exact = tabulate(times, [&](double t, Sample& sample) {
          const double x = std::max(0.0, t - a);
          const double before = is_abs ? -1.0 : 0.0;
          // J1 e1 + 0.5 J2 e2 = 0, e2 = 0.5 e1 + K s
          const double s = t > a ? 1.0 : before;
          const double way = before * std::min(t, a) + x;
          const double part = -0.5 * J2 * K / (J1 + 0.25 * J2);
          sample.acceleration[0] = part * s;
          sample.acceleration[1] = 0.5 * part * s + K * s;
          sample.velocity[0] = part * way;
          sample.velocity[1] = 0.5 * part * way + K * way + (is_abs ? K * a : 0.0);
        });
        const Scene plain =
            sceneFromText("a 1.5, b 0.8",
                          {"k of order 1: w2-0.5*w1-" + exactly(K) +
                           (is_abs ? "*abs(t-0.637)" : "*max(0,t-0.637)")},
                          "initial: {velocity: " + list({0.0, is_abs ? K * a : 0.0}) +
                              "}\nprinciple: " + principle);
        compareMethods(hazard, withFewSteps(plain), exact,
                       std::string(principle) + (is_abs ? " abs" : " max") + ", K " + text(K),
                       {sweptTolerances(), Stops::kKnown});
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
