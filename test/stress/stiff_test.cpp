// Stiffness: slip time constants, regularized friction and elastic couplings far faster than the
// motion they are part of. Every reference is an exact solution.
#include "stress/known_motion.h"

namespace variator_sim::test {
namespace {

constexpr double kEnd = 3.0;

/// Explicit steppers need about end / tau steps: more than that is a stop by name and need not take
/// long.
Scene limited(Scene scene) {
  scene.solver.maximum_steps = sizeOf(500, 5000);
  return scene;
}

std::vector<double> timeConstants() {
  std::vector<double> taus;
  for (double exponent = -1.0; exponent > -9.1; exponent -= sizeOf(2.0, 0.5)) {
    taus.push_back(std::pow(10.0, exponent));
  }
  return taus;
}

std::vector<double> tolerances() {
  return isLongForm() ? std::vector<double>{1e-4, 1e-6, 1e-8, 1e-10}
                      : std::vector<double>{1e-4, 1e-8};
}

/// Scenes in which tau is varied, on the slow motion.
std::vector<KnownMotion> slipScenes() {
  std::vector<KnownMotion> scenes;
  for (KnownMotion motion : knownMotions({2, 3}, true)) {
    for (double harmonic : {0.0, 0.3}) {
      if (!isLongForm() && harmonic != 0.0 && (motion.nonlinear || motion.order == 3)) continue;
      motion.harmonic = harmonic;
      scenes.push_back(motion);
    }
  }
  return scenes;
}

TEST(Stiffness, SlowMotionOfAStiffVariator) {
  Hazard hazard("stiffness", "slip time constant, turning ratio", "1e-1 .. 1e-9 s");
  Hazard accelerations("stiffness", "slip time constant, turning ratio: accelerations",
                       "1e-1 .. 1e-9 s");
  const std::vector<double> times = evenly(kEnd, 12);
  for (KnownMotion motion : slipScenes()) {
    for (double tau : timeConstants()) {
      motion.time_constant = tau;
      const Scene scene = limited(motion.scene());
      const auto exact = motion.exact(times);
      for (const Method& method : methodsOf(scene, tolerances())) {
        // (Of the shortest time constant accelerations are 1e9 times what velocities are off, which
        // at 1e-8 is 44 tolerances for the last bit of a velocity.)
        compareApart(hazard, accelerations, play(method.scene, times), exact, method.scene,
                     motion.label() + ", " + method.name, (tau < 5e-9 ? 3.0 : 1.0) * kAllowed);
      }
    }
  }
}

// The slip itself, from its start until it is long gone. Accelerations are as large as slip / tau
// at first, and what they come to afterwards is compared on its own.
TEST(Stiffness, TransientOfAStiffVariator) {
  Hazard hazard("stiffness", "slip time constant, transient", "1e-1 .. 1e-9 s");
  Hazard accelerations("stiffness", "slip time constant, transient: accelerations",
                       "1e-1 .. 1e-9 s");
  for (KnownMotion motion : knownMotions({2, 3}, false)) {
    for (double coupling : {0.0, 0.3}) {
      for (double tau : timeConstants()) {
        motion.coupling = coupling;
        motion.swing = 0.0;
        motion.slip = 0.5;
        motion.time_constant = tau;
        const Scene scene = limited(motion.scene());
        const std::vector<double> early = {0.1 * tau, 0.7 * tau, 3.0 * tau, 10.0 * tau, 30.0 * tau};
        std::vector<double> times = early;
        for (double time : evenly(kEnd, 4)) {
          if (time > 60.0 * tau) times.push_back(time);
        }
        const auto exact = motion.exact(times);
        for (const Method& method : methodsOf(scene, tolerances())) {
          const std::string label = motion.label() + ", " + method.name;
          const auto run = play(method.scene, times);
          // If accelerations are a state and begin with slip / tau, one rounding of that stays in
          // the null-space part of C and is integrated into the velocities.
          const double rounding = motion.principle == Principle::kGauss
                                      ? 0.0
                                      : std::numeric_limits<double>::epsilon() * motion.slip / tau *
                                            kEnd / method.tolerance;
          const double allowed = kAllowed + rounding;
          compareApart(hazard, accelerations, run, exact, method.scene, label, allowed);
          if (run.samples.size() <= early.size() || times.size() == early.size()) continue;
          test::Run later;
          test::Run exact_later;
          for (std::size_t n = early.size(); n < run.samples.size(); ++n) {
            later.samples.push_back(run.samples[n]);
            exact_later.samples.push_back(exact.samples[n]);
          }
          // Steps in the transient may err by tolerance * slip / tau in an acceleration. That
          // is along J^-1 (-u, 1), as C is constant, and decays like the slip itself.
          compareApart(hazard, accelerations, later, exact_later, method.scene,
                       label + ", after the transient", allowed);
        }
      }
    }
  }
}

// --- friction ---------------------------------------------------------------------------------
/// J w' = m - T tanh(w / w0), by the inverse function t(w) in long double.
class FrictionStop {
 public:
  FrictionStop(double inertia, double torque, double friction, double speed, double start)
      : J_(inertia), m_(torque), T_(friction), w0_(speed), start_(start) {}

  /// w at t: t(w) falls strictly between the start and the speed at which both torques balance.
  double velocity(double t) const {
    if (t <= 0.0) return start_;
    long double fast = start_;
    long double slow = w0_ * std::atanh(static_cast<long double>(m_ / T_));
    for (int n = 0; n < 200; ++n) {
      const long double middle = 0.5L * (fast + slow);
      if (middle == fast || middle == slow) break;
      (calcTime(middle) < t ? fast : slow) = middle;
    }
    return static_cast<double>(0.5L * (fast + slow));
  }
  double acceleration(double w) const { return (m_ - T_ * std::tanh(w / w0_)) / J_; }
  /// When w is `parts` layers w0 above the balance.
  double timeAt(double w) const { return static_cast<double>(calcTime(w)); }

 private:
  /// integral of dw J / (m - T tanh(w / w0)) from the start, with x = w / w0:
  ///     J w0 [m x + T ln(m cosh x - T sinh x)] / (m^2 - T^2)
  long double calcTime(long double w) const {
    const long double m = m_;
    const long double T = T_;
    const auto primitive = [&](long double x) {
      // ln |m cosh x - T sinh x| = |x| + ln |(m - T) + (m + T) exp(-2x)| / 2, for x >= 0
      const long double a = std::abs(x);
      const long double s = x < 0.0L ? -1.0L : 1.0L;
      return m * x +
             T * (a + std::log(0.5L * std::abs((m - s * T) + (m + s * T) * std::exp(-2.0L * a))));
    };
    return J_ * static_cast<long double>(w0_) *
           (primitive(w / w0_) - primitive(static_cast<long double>(start_) / w0_)) /
           (m * m - T * T);
  }
  double J_;
  double m_;
  double T_;
  double w0_;
  double start_;
};

/// A shaft that friction brings to rest against a motor, alone or with a second one geared to it
/// (`order` 0: alone; w2 = 0.5 w1 otherwise), which has the friction.
Scene frictionScene(int order, Principle principle, double speed) {
  const std::string friction =
      "f = Friction, coulomb: 2, regularization_speed: " + plainly(speed) + ", shaft: ";
  const std::string end = std::string("}\nprinciple: ") + toString(principle);
  if (order == 0) {
    return sceneFromText("a 1.5", {"m on a: 0.5", friction + "a"}, "initial: {velocity: [1]" + end);
  }
  // Order 3 does not say what the accelerations are: those of the gear.
  const double a = (0.25 - 1.0 * std::tanh(0.5 / speed)) / 1.5;
  return sceneFromText("a 1, b 2",
                       {"m on a: 0.25", friction + "b", "g" + ofOrder(order, "_2-0.5*_1")},
                       "initial: {velocity: [1, 0.5]" +
                           (order == 3 ? ", acceleration: " + list({a, 0.5 * a}) : "") + end);
}

/// The exact solution is of velocities.
test::Run withoutAngles(test::Run run) {
  for (Sample& sample : run.samples) std::fill(sample.angle, sample.angle + kMaxShafts, 0.0);
  return run;
}

TEST(Stiffness, FrictionStopsAShaft) {
  Hazard hazard("stiffness", "friction, slope T/w0", "1e1 .. 1e7 N m s/rad");
  Hazard accelerations("stiffness", "friction, slope T/w0: accelerations", "1e1 .. 1e7 N m s/rad");
  for (double exponent = 1.0; exponent < 7.1; exponent += sizeOf(2.0, 0.5)) {
    const double speed = 2.0 / std::pow(10.0, exponent);
    for (int order : {0, 1, 2, 3}) {
      // alone: J = 1.5, m = 0.5, T = 2 at w. Geared: by w1, J = 1 + 0.25 * 2, m = 0.25,
      // T = 0.5 * 2, and w2 / w0 = w1 / (2 w0)
      const FrictionStop stop = order == 0 ? FrictionStop(1.5, 0.5, 2.0, speed, 1.0)
                                           : FrictionStop(1.5, 0.25, 1.0, 2.0 * speed, 1.0);
      const double layer = order == 0 ? speed : 2.0 * speed;
      // Within the layer an error of time is seen through a slope of T / w0: sampled before it is
      // reached and when it has been left.
      const double arrival = stop.timeAt(20.0 * layer);
      const double settled = stop.timeAt(0.3 * layer) + 60.0 * layer * 1.5 / (order == 0 ? 2 : 1);
      std::vector<double> times;
      if (20.0 * layer < 1.0) {
        for (double part : {0.1, 0.5, 0.9}) times.push_back(part * arrival);
      }
      for (double late : {0.0, 0.1, 1.0, 5.0}) times.push_back(settled + late);
      const auto exact = tabulate(times, [&](double t, Sample& sample) {
        sample.velocity[0] = stop.velocity(t);
        sample.acceleration[0] = stop.acceleration(sample.velocity[0]);
        sample.velocity[1] = 0.5 * sample.velocity[0];
        sample.acceleration[1] = 0.5 * sample.acceleration[0];
      });
      for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
        const Scene scene = limited(frictionScene(order, principle, speed));
        for (const Method& method : methodsOf(scene, tolerances())) {
          const std::string label = "order " + std::to_string(order) + ", " + toString(principle) +
                                    ", slope " + text(2.0 / speed) + ", " + method.name;
          const test::Run run = withoutAngles(play(method.scene, times));
          // Under gauss the accelerations follow from the velocities. If the whole layer is
          // narrower than the velocities' tolerance, the velocities do not determine them.
          if (principle == Principle::kGauss && 20.0 * layer < kAllowed * method.tolerance) {
            hazard.compare(run, exact, method.scene, label, kAllowed, Columns::kVelocity);
            continue;
          }
          compareApart(hazard, accelerations, run, exact, method.scene, label);
        }
      }
    }
  }
}

// --- elastic coupling -------------------------------------------------------------------------
TEST(Stiffness, ElasticCoupling) {
  Hazard hazard("stiffness", "elastic coupling", "1e1 .. 1e7 N m/rad");
  Hazard accelerations("stiffness", "elastic coupling: accelerations", "1e1 .. 1e7 N m/rad");
  for (double exponent = 1.0; exponent < 7.1; exponent += sizeOf(3.0, 0.5)) {
    for (double damping_ratio : {0.0, 0.05, 1.0, 20.0}) {
      for (int order : {0, 1, 2, 3}) {
        for (Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
          ElasticDrive drive;
          drive.stiffness = std::pow(10.0, exponent);
          drive.damping_ratio = damping_ratio;
          drive.order = order;
          drive.principle = principle;
          // A swing that does not decay is followed for some periods only.
          const double frequency = drive.frequency();
          const double end = damping_ratio == 0.0 ? std::min(1.0, 100.0 / frequency) : 1.0;
          // Errors of the swing stay as long as it does, 1 / (damping ratio * frequency), and each
          // radian or so takes a step: so many of them add up.
          const double growth =
              1.0 + (damping_ratio == 0.0 ? frequency * end
                                          : std::min(frequency * end, 0.5 / damping_ratio));
          const std::vector<double> times = evenly(end, 16);
          const auto exact =
              tabulate(times, [&](double t, Sample& sample) { sample = drive.at(t); });
          const Scene scene = limited(sceneFromText(drive.yaml()));
          for (const Method& method : methodsOf(scene, tolerances())) {
            double allowed = kAllowed * growth;
            // Accelerations that are a state and are projected onto those of the torques know
            // these to the rounding of the angles, of size 1 (doc/evidence.md).
            if (order == 3 && principle == Principle::kGauss) {
              allowed += 64.0 * std::numeric_limits<double>::epsilon() * drive.stiffness /
                         method.tolerance;
            }
            compareApart(hazard, accelerations, play(method.scene, times), exact, method.scene,
                         "order " + std::to_string(order) + ", " + toString(principle) +
                             ", stiffness " + text(drive.stiffness) + ", damping ratio " +
                             text(damping_ratio) + ", " + method.name,
                         allowed);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim::test
