// Starts: off the constraints, at and near points where C loses rank, and at rest, where ratios of
// speeds are undefined. Either the motion from the nearest consistent start follows, or the start
// is refused or stopped by name.
#include "stress/known_motion.h"

namespace variator_sim::test {
namespace {

constexpr double kEnd = 2.0;

std::vector<double> tolerances() {
  return isLongForm() ? std::vector<double>{1e-4, 1e-6, 1e-8, 1e-10}
                      : std::vector<double>{1e-5, 1e-9};
}

// --- off the constraints ----------------------------------------------------------------------
// A start that is aside of a consistent one by `distance` along J^-1 C^T has that one as the
// nearest: with initial/project it is where the motion begins, without it is refused unless the
// distance is what printing in ten digits leaves.
TEST(Starts, OffAPlaneOfAccelerationsOrVelocities) {
  Hazard hazard("starts", "distance from the constraint, linear", "1e-15 .. 1e6");
  const std::vector<double> times = evenly(kEnd, 6);
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (int order : {1, 2}) {
      // under gauss accelerations are no data
      if (principle == Principle::kGauss && order == 2) continue;
      for (double coupling : {0.0, 0.5}) {
        KnownMotion motion;
        motion.principle = principle;
        motion.order = order;
        motion.coupling = coupling;
        const auto exact = motion.exact(times);
        const Scene consistent = motion.scene();
        const Sample start = motion.at(0.0);
        const double det = motion.inertia[0] * motion.inertia[1] - coupling * coupling;
        const double u = motion.ratio;
        const double d[2] = {(-u * motion.inertia[1] - coupling) / det,
                             (u * coupling + motion.inertia[0]) / det};
        for (int decade = -15; decade <= 6; decade += sizeOf(3, 1)) {
          for (double sign : {1.0, -1.0}) {
            const double distance = sign * std::pow(10.0, decade);
            for (bool project : {true, false}) {
              Scene scene = consistent;
              scene.initial.project = project;
              std::vector<double>& values =
                  order == 1 ? scene.initial.velocity : scene.initial.acceleration;
              const double* right = order == 1 ? start.velocity : start.acceleration;
              for (int i = 0; i < 2; ++i) {
                values[static_cast<std::size_t>(i)] = right[i] + distance * d[i];
              }
              for (const Method& method : methodsOf(scene, tolerances())) {
                const std::string label = motion.label() + ", off by " + text(distance) +
                                          (project ? ", projected, " : ", ") + method.name;
                const test::Run run = play(method.scene, times);
                // A start that is moved without permission makes another motion than the given one.
                if (!project && std::abs(distance) > 1e-7 && run.reason == StopReason::kNone) {
                  hazard.judge(std::numeric_limits<double>::infinity(), label + " (accepted)");
                  continue;
                }
                // Starts are projected if possible: velocities of size 5 and a distance of 1e6
                // leave roundings of 1e6.
                const double rounding =
                    std::abs(distance) * std::numeric_limits<double>::epsilon() / method.tolerance;
                hazard.compare(run, exact, method.scene, label, kAllowed * (1.0 + rounding),
                               Columns::kAll);
                if (project) {
                  EXPECT_EQ(run.reason, StopReason::kNone) << label << ": " << run.message;
                }
              }
            }
          }
        }
      }
    }
  }
}

/// psi = eps1^2 + eps2^2 - a^2 with J1 = J2 = J, M1' = m (doc/theory.md), from the angle
/// atan2(eps2, eps1) of the accelerations.
struct AccelerationCircle {
  static constexpr double kRadius = 2.0;
  static constexpr double kJ = 1.5;
  static constexpr double kRate = 3.0;
  static Sample at(double direction, double t) {
    const double kappa = kRate / (kRadius * kJ);
    const double z0 = std::atanh(std::cos(direction));
    const double z = kappa * t + z0;
    const double side = std::sin(direction) < 0.0 ? -1.0 : 1.0;
    const auto gd = [](double x) { return 2.0 * std::atan(std::tanh(0.5 * x)); };
    Sample sample;
    sample.time = t;
    sample.acceleration[0] = kRadius * std::tanh(z);
    sample.acceleration[1] = side * kRadius / std::cosh(z);
    sample.velocity[0] = kRadius / kappa * (std::log(std::cosh(z)) - std::log(std::cosh(z0)));
    sample.velocity[1] = side * kRadius / kappa * (gd(z) - gd(z0));
    return sample;
  }
  static std::string yaml(const std::string& start) {
    return sceneText("a 1.5, b 1.5",
                     {"m on a: 3*t", "c = AccelerationMagnitude, shafts: [a, b], magnitude: 2"},
                     start);
  }
};

// On a circle the nearest point is that in the same direction. At its centre there is none.
TEST(Starts, OffACircleOfAccelerations) {
  Hazard hazard("starts", "distance from the constraint, a circle", "0 and 1e-12 .. 1e12 radii");
  const std::vector<double> times = evenly(kEnd, 6);
  for (int decade = -12; decade <= 12; decade += sizeOf(3, 1)) {
    for (double direction : {0.3, 1.5, 2.9, -1.0, -2.2}) {
      const double radius = AccelerationCircle::kRadius * std::pow(10.0, decade);
      const Scene scene = sceneFromText(AccelerationCircle::yaml(
          "initial: {acceleration: " +
          list({radius * std::cos(direction), radius * std::sin(direction)}) +
          ", project: true}\n"));
      const auto exact = tabulate(
          times, [&](double t, Sample& sample) { sample = AccelerationCircle::at(direction, t); });
      compareMethods(hazard, scene, exact,
                     "direction " + text(direction) + ", radius " + text(radius),
                     {tolerances(), Stops::kAny});
    }
  }
  for (bool project : {false, true}) {
    const Scene scene = sceneFromText(
        AccelerationCircle::yaml(std::string("initial: {acceleration: [0, 0], project: ") +
                                 (project ? "true" : "false") + "}\n"));
    for (StepperKind stepper : steppersOf(scene)) {
      const test::Run run = play(withSolver(scene, stepper, 1e-8), times);
      hazard.stopped(run.reason, std::string("the centre, ") + toString(stepper));
    }
  }
}

// --- where C has lost rank --------------------------------------------------------------------
TEST(Starts, ExactlyAtSingularPoints) {
  Hazard hazard("starts", "exactly at singular points", "C = 0, equal rows");
  struct Place {
    const char* name;
    const char* constraints;  ///< formulas, `;` between
    int order;
    const char* initial;
  };
  const Place places[] = {
      {"power at rest", "w1*e1+2*w2*e2", 2, ""},
      {"power at rest, with a rate", "w1*e1+2*w2*e2-1", 2, ""},
      {"energy at rest", "w1^2+w2^2", 1, ""},
      {"third order at rest", "w1*j1+w2*j2", 3, ", acceleration: [0, 0, 0]"},
      {"third order at rest, inhomogeneous", "w1*j1+w2*j2+e1-e2", 3, ", acceleration: [1, 1, 0]"},
      {"factor phi1 at 0", "phi1*(e1-0.5*e2)", 2, ""},
      {"factor phi1 at 0, in motion", "phi1*(e1-0.5*e2)", 2, ", velocity: [1, 2, 0]"},
      {"factor phi1 at 0, order 1", "phi1*(w1-0.5*w2)", 1, ", velocity: [1, 2, 0]"},
      {"factor phi1 at 0, order 3", "phi1*(j1-0.5*j2)", 3, ", acceleration: [1, 2, 0]"},
      {"factor t", "t*(e1-0.5*e2)", 2, ""},
      {"factor t squared", "t^2*(e1-0.5*e2)", 2, ""},
      {"equal rows", "e1-0.5*e2;e1-0.5*e2", 2, ""},
      {"equal rows in other units", "e1-0.5*e2;1e6*(e1-0.5*e2)", 2, ""},
      {"equal rows, order 1", "w1-0.5*w2;2*w1-w2", 1, ""},
      {"equal rows, order 3", "j1-0.5*j2;2*j1-j2", 3, ""},
      {"rows that are equal at the start", "e1-0.5*e2;e1-0.5*e2+phi1*e3", 2, ""},
      {"rows that contradict", "e1-0.5*e2;e1-0.5*e2-1", 2, ""},
      {"rows that contradict, order 1", "w1-0.5*w2;w1-0.5*w2-1", 1, ""},
  };
  for (const Place& place : places) {
    std::vector<std::string> elements = {"q on a: 3"};
    std::istringstream formulas(place.constraints);
    for (std::string formula; std::getline(formulas, formula, ';');) {
      elements.push_back("k" + std::to_string(elements.size()) + ofOrder(place.order, formula));
    }
    for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
      for (bool project : {false, true}) {
        const Scene scene = sceneFromText(
            "a 1, b 2, c 0.5", elements,
            std::string("principle: ") + toString(principle) +
                "\ninitial: {project: " + (project ? "true" : "false") + place.initial + "}");
        for (StepperKind stepper : steppersOf(scene)) {
          const test::Run run = play(withSolver(scene, stepper, 1e-8), {0.0, 0.1, 1.0});
          const std::string label = std::string(place.name) + ", " + toString(principle) +
                                    (project ? ", projected, " : ", ") + toString(stepper);
          hazard.stopped(run.reason, label);
          EXPECT_FALSE(run.message.empty()) << label;
          EXPECT_EQ(run.end, 0.0) << label;
        }
      }
    }
  }
}

// A power of a constraint has C = 0 wherever it holds. A stepper that finds a motion nevertheless
// finds that of the gear.
TEST(Starts, OnAPowerOfAConstraint) {
  Hazard hazard("starts", "powers of psi: C = 0 all the way", "psi^2, psi^3");
  const std::vector<double> times = evenly(kEnd, 6);
  for (const char* psi : {"(e1-0.5*e2)^2", "(e1-0.5*e2)^3"}) {
    for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
      for (const char* start : {"[1, 2]", "[1, 2.5]", "[0, 0]"}) {
        for (bool project : {false, true}) {
          const double e1 = 3.0 / 9.0;
          const Scene scene = sceneFromText("a 1, b 2", {"q on a: 3", std::string("k: ") + psi},
                                            std::string("principle: ") + toString(principle) +
                                                "\ninitial: {acceleration: " + start +
                                                ", project: " + (project ? "true" : "false") + "}");
          const auto exact = tabulate(times, [&](double t, Sample& sample) {
            for (int i = 0; i < 2; ++i) {
              sample.angle[i] = 0.5 * (i + 1) * e1 * t * t;
              sample.velocity[i] = (i + 1) * e1 * t;
              sample.acceleration[i] = (i + 1) * e1;
            }
          });
          for (StepperKind stepper : steppersOf(scene)) {
            const Scene asked = withSolver(scene, stepper, 1e-8);
            hazard.compare(play(asked, times), exact, asked,
                           std::string(psi) + ", " + toString(principle) + ", from " + start +
                               (project ? ", projected, " : ", ") + toString(stepper),
                           kAllowed, Columns::kAll);
          }
        }
      }
    }
  }
}

// Without a torque, all accelerations on a circle have the same reaction: there is no least one to
// start from.
TEST(Starts, AtRestWithManyLeastReactions) {
  Hazard hazard("starts", "least reaction not unique", "circles of accelerations");
  for (const char* inertia : {"1.5", "1", "3"}) {
    for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
      const Scene scene = sceneFromText(std::string("a 1.5, b ") + inertia,
                                        {"c = AccelerationMagnitude, shafts: [a, b], magnitude: 2"},
                                        std::string("principle: ") + toString(principle));
      for (StepperKind stepper : steppersOf(scene)) {
        const test::Run run = play(withSolver(scene, stepper, 1e-8), {0.0, 0.1, 1.0});
        hazard.stopped(run.reason, std::string("inertias 1.5 and ") + inertia + ", " +
                                       toString(principle) + ", " + toString(stepper));
      }
    }
  }
}

// A constraint's formula may be as small as it likes at the start: where C is not zero the motion
// is that of the gear.
TEST(Starts, NearSingularPoints) {
  Hazard hazard("starts", "near singular points: C to its later size", "1e-1 .. 1e-15");
  const std::vector<double> times = evenly(kEnd, 6);
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (int order : {1, 2, 3}) {
      for (int decade = 1; decade <= 15; decade += sizeOf(2, 1)) {
        for (double sign : {1.0, -1.0}) {
          // with -1 the factor goes through zero on the way
          const double start = sign * std::pow(10.0, -decade);
          // w2 = 2 w1 = 2 + 2 * 3 t / (1 + 4 * 2), all of the torque on the first shaft
          const double e1 = 3.0 / 9.0;
          const Scene scene = sceneFromText(
              "a 1, b 2", {"q on a: 3", "k" + ofOrder(order, "phi1*(_1-0.5*_2)")},
              std::string("principle: ") + toString(principle) +
                  "\ninitial: {angle: " + list({start, 0.0}) + ", velocity: [1, 2]" +
                  (order == 3 ? ", acceleration: " + list({e1, 2.0 * e1}) : "") + "}");
          const auto exact = tabulate(times, [&](double t, Sample& sample) {
            sample.angle[0] = start + t + 0.5 * e1 * t * t;
            sample.velocity[0] = 1.0 + e1 * t;
            sample.acceleration[0] = e1;
            sample.angle[1] = 2.0 * (sample.angle[0] - start);
            sample.velocity[1] = 2.0 * sample.velocity[0];
            sample.acceleration[1] = 2.0 * e1;
          });
          compareMethods(hazard, scene, exact,
                         "order " + std::to_string(order) + ", " + toString(principle) +
                             ", phi1 from " + text(start),
                         {tolerances(), Stops::kAny, Columns::kAll});
        }
      }
    }
  }
}

// Two constraints whose rows differ by a small part: the gear e1 : e2 : e3 = 1 : 2 : 1/2 for every
// part but 0. All numbers of the formulas are powers of two, so that they say exactly that.
TEST(Starts, NearlyDependentRows) {
  Hazard hazard("starts", "rows of C apart by", "2^-1 .. 2^-60, and 0");
  const std::vector<double> times = evenly(kEnd, 6);
  const double inertia = 1.0 + 4.0 * 2.0 + 0.25 * 0.5;
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (int order : {1, 2, 3}) {
      for (int exponent = sizeOf(3, 1); exponent <= 60; exponent += sizeOf(4, 1)) {
        const double part = std::ldexp(1.0, -exponent);
        const double e1 = 3.0 / inertia;
        const Scene scene = sceneFromText(
            "a 1, b 2, c 0.5",
            {"q on a: 3*cos(t)", "k" + ofOrder(order, "_1-0.5*_2"),
             "l" + ofOrder(order, "_1-0.5*_2+" + exactly(part) + "*(_3-0.25*_2)")},
            std::string("principle: ") + toString(principle) + "\ninitial: {velocity: [0, 0, 0]" +
                (order == 3 ? ", acceleration: " + list({e1, 2.0 * e1, 0.5 * e1}) : "") + "}");
        const double gear[3] = {1.0, 2.0, 0.5};
        const auto exact = tabulate(times, [&](double t, Sample& sample) {
          for (int i = 0; i < 3; ++i) {
            sample.angle[i] = gear[i] * e1 * (1.0 - std::cos(t));
            sample.velocity[i] = gear[i] * e1 * std::sin(t);
            sample.acceleration[i] = gear[i] * e1 * std::cos(t);
          }
        });
        compareMethods(hazard, scene, exact,
                       "order " + std::to_string(order) + ", " + toString(principle) + ", 2^-" +
                           std::to_string(exponent),
                       {tolerances(), Stops::kAny, Columns::kAll});
      }
    }
  }
}

// --- at rest ----------------------------------------------------------------------------------
/// Two shafts at rest, J = 0.8 and 2.
Scene restScene(const std::vector<std::string>& elements, Principle principle,
                const std::string& initial = "") {
  return sceneFromText(
      "a 0.8, b 2.0", elements,
      std::string("principle: ") + toString(principle) + "\ninitial: {" + initial + "}");
}

/// A gear of ratio 1/2 under a constant torque, `since` seconds after it has set off from rest.
void writeSetOff(double e1, double since, Sample& sample) {
  for (int i = 0; i < 2; ++i) {
    const double e = i == 0 ? e1 : 0.5 * e1;
    sample.angle[i] = 0.5 * e * since * since;
    sample.velocity[i] = e * since;
    sample.acceleration[i] = e;
  }
}

/// Variators of order 1 to 3.
const char* const kRest[] = {"v of order 1: w2-0.5*w1", "v: 0.2*(e2-0.5*e1)+w2-0.5*w1",
                             "v of order 3: 0.04*(j2-0.5*j1)+0.4*(e2-0.5*e1)+w2-0.5*w1"};

// Slip is zero at rest, so every variator is the gear w2 = w1 / 2 there.
TEST(Starts, AtRestUnderAMotor) {
  Hazard hazard("starts", "at rest: a motor sets in", "every order, torque 1e-9 .. 1e9 N m");
  const std::vector<double> times = evenly(kEnd, 6);
  const std::string constraints[] = {
      kRest[0],
      kRest[1],
      kRest[2],
      "v: 0.2*(e2-0.5*e1)*(1+0.01*(w1^2+w2^2))+w2-0.5*w1",
      "v = SlipRatio, shafts: [a, b], time_constant: 0.1, ratio: 0.5",
      "v = KinematicRatio, shafts: [a, b], ratio: 0.5",
  };
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (const std::string& constraint : constraints) {
      for (int decade = -9; decade <= 9; decade += sizeOf(6, 3)) {
        const double torque = std::pow(10.0, decade);
        const double e1 = torque / (0.8 + 0.25 * 2.0);
        const bool is_third = constraint == kRest[2];
        Scene scene = restScene({"m on a: " + plainly(torque), constraint}, principle,
                                is_third ? "acceleration: " + list({e1, 0.5 * e1}) : "");
        scene.solver.maximum_steps = 2000;
        const auto exact =
            tabulate(times, [&](double t, Sample& sample) { writeSetOff(e1, t, sample); });
        for (const Method& method : methodsOf(scene, tolerances())) {
          for (bool relative_only : {false, true}) {
            Scene asked = method.scene;
            if (relative_only) asked.solver.absolute_tolerance = 0.0;
            hazard.compare(play(asked, times), exact, asked,
                           std::string(toString(principle)) + ", " + constraint + ", torque " +
                               text(torque) + ", " + method.name +
                               (relative_only ? " relative" : ""),
                           kAllowed, Columns::kAll);
          }
        }
      }
    }
  }
}

// Nothing acts, nothing moves, for however long; then a command comes, at whatever time.
TEST(Starts, AtRestUntilACommand) {
  Hazard hazard("starts", "at rest until a command at", "1e-6 .. 1e6 s");
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (int order : {1, 2, 3}) {
      for (bool sleep : {true, false}) {
        for (int decade = -6; decade <= (sleep ? 6 : 2); decade += sizeOf(3, 1)) {
          const double begin = std::pow(10.0, decade);
          Scene scene = restScene({"m on a from u", kRest[order - 1]}, principle);
          scene.solver.sleep = sleep;
          std::vector<double> times = {0.5 * begin, begin};
          for (double later : {0.1, 1.0, 2.0}) times.push_back(begin + later);
          // R jumps by C^T Lambda alone, so accelerations jump to those of the gear at every order.
          const double e1 = 4.0 / (0.8 + 0.25 * 2.0);
          const auto exact = tabulate(times, [&](double t, Sample& sample) {
            if (t >= begin) writeSetOff(e1, t - begin, sample);
          });
          compareMethods(hazard, scene, exact,
                         "order " + std::to_string(order) + ", " + toString(principle) + ", at " +
                             text(begin) + (sleep ? "" : ", no sleep"),
                         {tolerances(), Stops::kAny, Columns::kAll, {{begin, 0, 4.0}}},
                         [&](double tolerance) {
                           // begin + later is rounded in the 16th digit
                           return kAllowed * (1.0 + 4.0 * begin * kEps / tolerance);
                         });
        }
      }
    }
  }
}

// Laws that are not defined at rest.
TEST(Starts, AtRestWithUndefinedRatios) {
  Hazard hazard("starts", "at rest: laws undefined there", "0/0, 1/0, infinite slopes, C = 0");
  struct Law {
    const char* name;
    std::string torque;  ///< line m
    std::string constraint;
    /// Continuous at rest, though its derivatives are not: gauss, which needs none, has a motion.
    bool is_continuous = false;
  };
  const std::string constant = "m on a: 3";
  const Law laws[] = {
      {"ratio of order 1", constant, "v of order 1: w2/w1-0.5"},
      {"ratio of order 2", constant, "v: 0.2*(e2-0.5*e1)+w2/w1-0.5"},
      {"ratio of accelerations", "m on a: 0*t", "v: e2/e1-0.5"},
      {"ratio in the time constant", constant, "v: (0.2+w2/w1)*(e2-0.5*e1)+w2-0.5*w1"},
      {"logarithm of a ratio", constant, "v: e2-0.5*e1+log(w2/w1)"},
      {"root of the speed", constant, "v: e2-0.5*e1+sqrt(w2)-sqrt(w1)", true},
      {"length of the velocities", constant, "v: e2-0.5*e1+0.1*sqrt(w1^2+w2^2)", true},
      {"power over speed", "m on a: 100/w1", kRest[1]},
      {"root of the energy", "m on a: -sqrt(0.8*w1^2+2*w2^2)", kRest[1], true},
      {"traction curve", constant,
       "v = TractionCurve, shafts: [a, b], ratio: 0.6, inertia: 2, nominal_torque: 20, "
       "nominal_slip: 0.03"},
      {"power flow", constant, "v = PowerFlow, shafts: [a, b], inertias: [0.8, 2.0], power: 10"},
      {"power flow, efficiency", constant,
       "v = PowerFlow, shafts: [a, b], inertias: [0.8, 2.0], efficiency: 0.9, smoothing_power: 1"},
  };
  for (const Law& law : laws) {
    for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
      for (bool project : {false, true}) {
        const Scene scene =
            restScene({law.torque, law.constraint}, principle, project ? "project: true" : "");
        for (StepperKind stepper : steppersOf(scene)) {
          const test::Run run = play(withSolver(scene, stepper, 1e-8), {0.0, 0.1, 1.0});
          const std::string label =
              std::string(law.name) + ", " + toString(principle) + ", " + toString(stepper);
          if (law.is_continuous && principle == Principle::kGauss) {
            const StepperKind other = stepper == StepperKind::kFehlberg78
                                          ? StepperKind::kDopri5
                                          : StepperKind::kFehlberg78;
            const std::vector<double> times = {0.0, 0.1, 1.0};
            hazard.compare(run, play(withSolver(scene, other, 1e-12), times),
                           withSolver(scene, stepper, 1e-8), label, kAllowed, Columns::kAll);
            continue;
          }
          hazard.stopped(run.reason, label);
          EXPECT_TRUE(run.samples.empty()) << label;
        }
      }
    }
  }
}

// psi = e2 - e1/2 + the direction of (w1, w2), which under gauss has a value at rest, 0, but is
// another one everywhere around: the motion starts straight in the direction that it keeps.
TEST(Starts, AtRestWithADirection) {
  Hazard hazard("starts", "at rest: direction of the velocities", "gauss");
  double e1 = 1.0;
  // J1 e1 + J2 e2 / 2 = 3, e2 = e1/2 - atan2(e2, e1)
  double low = 0.0;
  double high = 10.0;
  for (int n = 0; n < 200; ++n) {
    e1 = 0.5 * (low + high);
    const double e2 = 3.0 - 0.8 * e1;
    (e2 - 0.5 * e1 + std::atan2(e2, e1) > 0.0 ? low : high) = e1;
  }
  const double accelerations[2] = {e1, 3.0 - 0.8 * e1};
  const std::vector<double> times = evenly(kEnd, 6);
  const auto exact = tabulate(times, [&](double t, Sample& sample) {
    for (int i = 0; i < 2; ++i) {
      sample.angle[i] = 0.5 * accelerations[i] * t * t;
      sample.velocity[i] = accelerations[i] * t;
      sample.acceleration[i] = accelerations[i];
    }
  });
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    compareMethods(hazard, restScene({"m on a: 3", "v: e2-0.5*e1+atan2(w2,w1)"}, principle), exact,
                   toString(principle), {tolerances(), Stops::kAny, Columns::kAll});
  }
}

// Laws that are defined at rest, by each stepper against fehlberg78 and radau at a tolerance a
// thousand times tighter.
TEST(Starts, AtRestWithEveryLaw) {
  Hazard hazard("starts", "at rest: every shipped law", "two methods, 1e-3 of the tolerance");
  const std::string motors[] = {
      "m = MotorCurve, shaft: a, characteristic: kloss, breakdown_torque: 30, synchronous_speed: "
      "50, critical_slip: 0.2",
      "m = MotorCurve, shaft: a, characteristic: dc, stall_torque: 12, no_load_speed: 250",
      "m = MotorCurve, shaft: a, characteristic: table, table: {speed: [0, 20, 40, 48, 50], "
      "torque: [20, 22, 30, 18, 0], beyond: linear}",
      "m = DieselEngine, shaft: a, full_load: {speed: [0, 30, 60, 80, 105, 115], torque: [0, 5, "
      "9.5, 11, 10.5, 0]}, rack: {topic: rack, hold: first_order_lag, time_constant: 0.4, "
      "initial: 0.2}, friction: {constant: 0.3, linear: 0.004}, idle_governor: {speed: 40, band: "
      "8}"};
  const std::string loads[] = {
      "l = Propeller, shaft: b, coefficient: 0.02",
      "l = Propeller, shaft: b, torque_coefficient: 0.0035, diameter: 0.3, density: 1025, advance: "
      "{speed: 4, slope: 0.03}, regularization_speed: 0.5",
      "l = Friction, shaft: b, coulomb: 1, static: 1.5, stribeck_speed: 0.3, viscous: 0.1, "
      "regularization_speed: 0.05",
      "l = VehicleResistance, shaft: b, law: davis, wheel_radius: 0.05, ratio: 4.5, constant: 9, "
      "linear: 2.5, quadratic: 0.28, mass: 9",
      "l = CuttingTorque, shaft: b, torque: 2, begin: 0.5, ramp: 0.5, end: 12"};
  const std::string constraints[] = {
      "v = SlipRatio, shafts: [a, b], time_constant: 0.2, ratio: 0.6",
      "v = KinematicRatio, shafts: [a, b], ratio: 0.6",
      "v = VBeltRatio, shafts: [a, b], ratio_low: 0.4, ratio_high: 1.3, speed: 30",
      "v = AccelerationMagnitude, shafts: [a, b], magnitude: 6",
      "v = JerkLimit, shaft: b, limit: 4, time_constant: 0.2, acceleration: 3"};
  const std::vector<double> times = evenly(3.0, 6);
  const auto play_at = [&](const Scene& scene, StepperKind stepper, double tolerance) {
    return play(withSolver(scene, stepper, tolerance), times);
  };
  for (const std::string& motor : motors) {
    for (const std::string& load : loads) {
      for (const std::string& constraint : constraints) {
        for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
          const std::string name = motor.substr(0, 45) + "; " + load.substr(0, 45) + "; " +
                                   constraint.substr(0, 20) + "; " + toString(principle);
          Scene scene = restScene({motor, load, constraint}, principle);
          scene.solver.maximum_steps = 20000;
          for (double tolerance : {1e-6, 1e-8}) {
            if (!isLongForm() && tolerance < 1e-6) continue;
            const test::Run explicitly = play_at(scene, StepperKind::kFehlberg78, 1e-3 * tolerance);
            const test::Run implicitly = play_at(scene, StepperKind::kRadau, 1e-3 * tolerance);
            for (StepperKind stepper : steppersOf(scene)) {
              const test::Run& reference = stepper == StepperKind::kRadau ? explicitly : implicitly;
              const test::Run run = play_at(scene, stepper, tolerance);
              const std::string label = name + ", " + describe(stepper, tolerance);
              // The motion ends for all steppers: one that goes on beyond a reference that stopped
              // for good is wrong.
              if (run.reason == StopReason::kNone && reference.reason != StopReason::kNone &&
                  reference.reason != StopReason::kStepLimit) {
                hazard.judge(std::numeric_limits<double>::infinity(),
                             label + " goes on beyond: " + reference.message);
                continue;
              }
              hazard.compare(run, reference, withSolver(scene, stepper, tolerance), label, kAllowed,
                             Columns::kAll);
            }
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
