// Sizes: inertias far apart, an inertia matrix near the edge of being positive definite, and scenes
// written in other units of time, angle and inertia, which must give the motion in those units.
// Every reference is an exact solution.

#include "stress/known_motion.h"

namespace variator_sim::test {
namespace {

constexpr double kEnd = 3.0;

std::vector<double> tolerances() {
  return isLongForm() ? std::vector<double>{1e-4, 1e-6, 1e-8, 1e-10}
                      : std::vector<double>{1e-5, 1e-9};
}

/// Powers of ten from 10^-`largest` to 10^`largest`.
std::vector<double> powers(int largest) {
  std::vector<double> values;
  for (int n = -largest; n <= largest; n += sizeOf(3, 1)) values.push_back(std::pow(10.0, n));
  return values;
}

/// Every kind of KnownMotion at a mild time constant.
const std::vector<KnownMotion> kKinds = knownMotions({1, 2, 3}, true);

TEST(Scaling, InertiaRatios) {
  Hazard hazard("scaling", "inertia ratio J2 / J1", "1e-6 .. 1e6");
  const std::vector<double> times = evenly(kEnd, 12);
  for (KnownMotion motion : kKinds) {
    for (double ratio : powers(6)) {
      motion.inertia[0] = 1.0;
      motion.inertia[1] = ratio;
      // a reaction of the size of the smaller inertia: it moves that one about as much as the
      // motion does
      motion.reaction = 3.0 * std::min(1.0, ratio);
      compareMethods(hazard, motion.scene(), motion.exact(times),
                     motion.label() + ", ratio " + text(ratio),
                     {tolerances(), Stops::kAny, Columns::kAll});
    }
  }
}

// J = [1 c; c 1]: its smaller eigenvalue is 1 - c.
TEST(Scaling, NearlySingularInertia) {
  Hazard hazard("scaling", "inertia coupling, 1 - J12 / sqrt(J1 J2)", "1 .. 1e-6");
  const std::vector<double> times = evenly(kEnd, 12);
  for (KnownMotion motion : kKinds) {
    for (int n = 0; n <= 6; n += sizeOf(2, 1)) {
      const double rest = std::pow(10.0, -n);
      for (double sign : {1.0, -1.0}) {
        if (n == 0 && sign < 0.0) continue;
        motion.inertia[0] = 1.0;
        motion.inertia[1] = 1.0;
        motion.coupling = sign * (1.0 - rest);
        motion.reaction = rest;
        compareMethods(hazard, motion.scene(), motion.exact(times),
                       motion.label() + ", J12 " + text(sign) + " - " + text(sign * rest),
                       {tolerances(), Stops::kAny, Columns::kAll});
      }
    }
  }
}

/// A motion in other units, to relative tolerances only: nothing in it passes through zero.
void sweepUnits(Hazard& hazard, const char* unit, int largest,
                void (*scale)(KnownMotion&, double)) {
  for (KnownMotion motion : kKinds) {
    motion.trend = 3.0;
    for (double factor : powers(largest)) {
      scale(motion, factor);
      const std::vector<double> times = evenly(kEnd * motion.time_scale, 12);
      const auto exact = motion.exact(times);
      Scene scene = motion.scene();
      // seconds of the scene: these limits are no part of the motion
      scene.solver.maximum_step *= motion.time_scale;
      for (const Method& method : methodsOf(scene, tolerances())) {
        Scene asked = method.scene;
        asked.solver.absolute_tolerance = 0.0;
        hazard.compare(play(asked, times), exact, asked,
                       motion.label() + ", " + unit + " times " + text(factor) + ", " + method.name,
                       kAllowed, Columns::kAll);
      }
    }
  }
}

TEST(Scaling, UnitOfTime) {
  Hazard hazard("scaling", "unit of time, absolute tolerance 0", "1e-6 .. 1e6");
  sweepUnits(hazard, "time", 6,
             [](KnownMotion& motion, double factor) { motion.time_scale = factor; });
}

TEST(Scaling, UnitOfAngle) {
  Hazard hazard("scaling", "unit of angle, absolute tolerance 0", "1e-9 .. 1e9");
  sweepUnits(hazard, "angles", 9,
             [](KnownMotion& motion, double factor) { motion.angle_scale = factor; });
}

TEST(Scaling, UnitOfInertia) {
  Hazard hazard("scaling", "unit of inertia and torque, absolute tolerance 0", "1e-9 .. 1e9");
  sweepUnits(hazard, "inertias", 9,
             [](KnownMotion& motion, double factor) { motion.inertia_scale = factor; });
}

TEST(Scaling, AllUnits) {
  Hazard hazard("scaling", "all units at once, absolute tolerance 0", "1e-6 .. 1e6");
  sweepUnits(hazard, "all", 6, [](KnownMotion& motion, double factor) {
    motion.time_scale = factor;
    motion.angle_scale = 1.0 / factor;
    motion.inertia_scale = factor;
    motion.psi_scale = factor;
  });
}

// An absolute tolerance in the same unit as the angles gives the same motion in that unit.
TEST(Scaling, AbsoluteTolerance) {
  Hazard hazard("scaling", "unit of angle, absolute tolerance in the same unit", "1e-9 .. 1e9");
  const std::vector<double> times = evenly(kEnd, 12);
  for (KnownMotion motion : kKinds) {
    for (double factor : powers(9)) {
      motion.angle_scale = factor;
      const auto exact = motion.exact(times);
      const Scene scene = motion.scene();
      for (const Method& method : methodsOf(scene, tolerances())) {
        Scene asked = method.scene;
        asked.solver.absolute_tolerance = method.tolerance * factor;
        hazard.compare(play(asked, times), exact, asked,
                       motion.label() + ", angles times " + text(factor) + ", " + method.name,
                       kAllowed, Columns::kAll);
      }
    }
  }
}

// A torque that is curved in the velocity: J w' = -k w^2, w = w(0) / (1 + k w(0) t / J), on a shaft
// geared to a second one by each order. The smaller the numbers, the larger k.
TEST(Scaling, UnitOfAngleOfACurvedTorque) {
  Hazard hazard("scaling", "unit of angle, quadratic torque, absolute tolerance 0", "1e-9 .. 1e9");
  for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (int order : {0, 1, 2, 3}) {
      for (double unit : powers(9)) {
        const double start = 4.0 * unit;
        const double inertia = order == 0 ? 1.5 : 1.0 + 0.25 * 2.0;
        const auto velocity = [&](double t) { return start / (1.0 + 2.0 * 4.0 * t / inertia); };
        const std::vector<double> times = evenly(kEnd, 12);
        const auto exact = tabulate(times, [&](double t, Sample& sample) {
          sample.velocity[0] = velocity(t);
          sample.acceleration[0] = -2.0 / unit / inertia * sample.velocity[0] * sample.velocity[0];
          sample.angle[0] = unit * (1.0 + inertia / 2.0 * std::log1p(2.0 * 4.0 * t / inertia));
          sample.velocity[1] = 0.5 * sample.velocity[0];
          sample.acceleration[1] = 0.5 * sample.acceleration[0];
          sample.angle[1] = 0.5 * sample.angle[0];
        });
        std::vector<std::string> elements = {"q on a: -" + exactly(2.0 / unit) + "*w1*abs(w1)"};
        if (order > 0) elements.push_back("g" + ofOrder(order, "_2-0.5*_1"));
        const auto pair = [&](double value) {
          return order == 0 ? list({value}) : list({value, 0.5 * value});
        };
        std::string initial = "initial: {angle: " + pair(unit) + ", velocity: " + pair(start);
        if (order == 3) initial += ", acceleration: " + pair(-2.0 / unit / inertia * start * start);
        Scene scene = sceneFromText(order == 0 ? "a 1.5" : "a 1, b 2", elements,
                                    initial + "}\nprinciple: " + toString(principle));
        scene.solver.maximum_steps = 20000;
        for (const Method& method : methodsOf(scene, tolerances())) {
          Scene asked = method.scene;
          asked.solver.absolute_tolerance = 0.0;
          hazard.compare(play(asked, times), exact, asked,
                         "order " + std::to_string(order) + ", " + toString(principle) +
                             ", angles times " + text(unit) + ", " + method.name,
                         kAllowed, Columns::kAll);
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
