/// Drivetrains whose motion is known in closed form whatever their parameters, for sweeps over
/// these.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "stress/methods.h"

namespace variator_sim::test {

/// Two shafts and a variator of a ratio u(t) = u0 + u1 sin(0.7 t), made the other way round: the
/// motion
///     Omega1 = 5 + g t + sin t,   Omega2' = u Omega1'
/// and the reaction
///     gauss:              R = (-u, 1) L sin t
///     generalized_gauss:  R' = (-u, 1) L cos t
/// are chosen, and the torque Q = J Omega' + n - R and the constraint's function of time p follow.
/// The direction of C is (-u, 1) for every order,
///     1:  w2 - u w1 - p = 0
///     2:  tau (e2 - u e1) [1 + 0.05 (e1^2 + e2^2)] + w2 - u w1 - p = 0   ([..] when `nonlinear`)
///     3:  tau^2 (j2 - u j1) + 2 tau (e2 - u e1) + w2 - u w1 - p = 0,
/// since e2 - u e1 is zero. With u constant, and psi linear, the motion may begin off the slow
/// motion by a slip y: it decays as exp(-t/tau) (order 2) or (1 + t/tau) exp(-t/tau) (order 3),
/// along J^-1 (-u, 1).
///
/// Without `restoring` nothing restores a motion that was put aside, so errors of the accelerations
/// stay and those of velocities and angles grow like t and t^2.
struct KnownMotion {
  int order = 2;
  bool nonlinear = false;
  Principle principle = Principle::kGeneralizedGauss;
  double time_constant = 0.2;  ///< tau, s
  double ratio = 0.5;          ///< u0
  double swing = 0.2;          ///< u1
  double trend = 0.0;          ///< g
  double slip = 0.0;           ///< y at the start; needs swing = 0 and linear psi
  double inertia[2] = {0.8, 2.0};
  double coupling = 0.0;   ///< J12
  double harmonic = 0.0;   ///< J1 (1 + harmonic cos phi1); needs angle_scale = 1
  double restoring = 0.0;  ///< b: Q gets -b (w - Omega), zero on the motion itself; no slip then
  double reaction = 3.0;   ///< L; none with a harmonic and generalized_gauss
  /// The same motion in other units: numbers of time, angle and inertia are so many times larger.
  double time_scale = 1.0;
  double angle_scale = 1.0;
  double inertia_scale = 1.0;
  double psi_scale = 1.0;

  bool hasReactionOfItsOwn() const {
    return harmonic != 0.0 && principle == Principle::kGeneralizedGauss;
  }

  std::string yaml() const {
    const std::string T = "(t*" + exactly(1.0 / time_scale) + ")";
    const std::string u = "(" + exactly(ratio) + "+" + exactly(swing) + "*sin(0.7*" + T + "))";
    const std::string du = "(" + exactly(0.7 * swing) + "*cos(0.7*" + T + "))";
    const std::string I = "(0.5*((1-cos(1.7*" + T + "))/1.7-(1-cos(0.3*" + T + "))/0.3))";
    const std::string W1 = "(5+" + exactly(trend) + "*" + T + "+sin(" + T + "))";
    const std::string A1 = "(" + exactly(trend) + "+cos(" + T + "))";
    const std::string W2 = "(" + exactly(5.0 * ratio) + "+" + exactly(ratio * trend) + "*" + T +
                           "+" + exactly(ratio) + "*sin(" + T + ")+" +
                           exactly(swing * trend / 0.7) + "*(1-cos(0.7*" + T + "))+" +
                           exactly(swing) + "*" + I + ")";
    const double wa = time_scale / angle_scale;
    const double ea = wa * time_scale;
    const double ja = ea * time_scale;
    const auto times = [](const char* variable, double factor) {
      return "(" + std::string(variable) + "*" + exactly(factor) + ")";
    };
    const std::string slip_velocity = "(" + times("w2", wa) + "-" + u + "*" + times("w1", wa) +
                                      "-(" + W2 + "-" + u + "*" + W1 + "))";
    const std::string slip_acceleration =
        "(" + times("e2", ea) + "-" + u + "*" + times("e1", ea) + ")";
    const std::string tau = exactly(time_constant);
    std::string psi;
    if (order == 1) {
      psi = slip_velocity;
    } else if (order == 2) {
      psi = tau + "*" + slip_acceleration;
      if (nonlinear) {
        psi += "*(1+0.05*(" + times("e1", ea) + "^2+" + times("e2", ea) + "^2))";
      }
      psi += "+" + slip_velocity;
    } else {
      const std::string square = exactly(time_constant * time_constant);
      psi = square + "*(" + times("j2", ja) + "-" + u + "*" + times("j1", ja) + ")+2*" + tau + "*" +
            slip_acceleration + "+" + slip_velocity + "-" + square + "*" + du + "*" + A1;
    }
    const double L = hasReactionOfItsOwn() ? 0.0 : reaction;
    const std::string R2 = "(" + exactly(L) + "*sin(" + T + "))";
    const std::string R1 = principle == Principle::kGauss
                               ? "(-" + u + "*" + R2 + ")"
                               : "(-" + exactly(L) + "*(" + exactly(ratio) + "*sin(" + T + ")+" +
                                     exactly(swing) + "*" + I + "))";
    std::string J1 = exactly(inertia[0]);
    std::string n1;
    if (harmonic != 0.0) {
      n1 = "-" + exactly(0.5 * inertia[0] * harmonic) + "*sin(phi1)*" + times("w1", wa) + "^2";
      J1 = "(" + J1 + "+" + exactly(inertia[0] * harmonic) + "*cos(phi1))";
    }
    const std::string A2 = "(" + u + "*" + A1 + ")";
    const std::string c = exactly(coupling);
    const double torque_scale = inertia_scale * angle_scale / (time_scale * time_scale);
    const std::string Q1 =
        exactly(torque_scale) + "*(" + J1 + "*" + A1 + "+" + c + "*" + A2 + n1 + "-" + R1 + ")";
    const std::string Q2 = exactly(torque_scale) + "*(" + exactly(inertia[1]) + "*" + A2 + "+" + c +
                           "*" + A1 + "-" + R2 + ")";
    const auto restore = [&](const char* variable, const std::string& speed) {
      return restoring == 0.0 ? std::string()
                              : "-" + exactly(restoring * torque_scale) + "*(" +
                                    times(variable, wa) + "-" + speed + ")";
    };
    std::string text = "shafts: [a, b]\n";
    if (harmonic != 0.0) {
      text += "a: {inertia: {mean: " + plainly(inertia_scale * inertia[0]) +
              ", harmonics: [{order: 1, cos: " + plainly(inertia_scale * inertia[0] * harmonic) +
              "}]}}\n";
    } else {
      text += "a: {inertia: " + plainly(inertia_scale * inertia[0]) + "}\n";
    }
    text += "b: {inertia: " + plainly(inertia_scale * inertia[1]) + "}\n";
    if (coupling != 0.0) {
      text += "inertia_coupling: [[a, b, " + plainly(inertia_scale * coupling) + "]]\n";
    }
    text += "torques: [qa, qb]\n";
    text += "qa: {type: variator_sim/ExpressionTorque, shaft: a, torque: \"" + Q1 +
            restore("w1", W1) + "\"}\n";
    text += "qb: {type: variator_sim/ExpressionTorque, shaft: b, torque: \"" + Q2 +
            restore("w2", W2) + "\"}\n";
    text += "constraints: [v]\nv: {type: variator_sim/ExpressionConstraint, order: " +
            std::to_string(order) + ", expression: \"" + exactly(psi_scale) + "*(" + psi + ")\"}\n";
    text += std::string("principle: ") + toString(principle) + "\n";
    const Sample start = at(0.0);
    const auto list = [](const double* x) {
      return "[" + plainly(x[0]) + ", " + plainly(x[1]) + "]";
    };
    text += "initial: {angle: " + list(start.angle) + ", velocity: " + list(start.velocity);
    // Under gauss the accelerations follow from the rest, but with order 3.
    if (principle == Principle::kGeneralizedGauss || order == 3) {
      text += ", acceleration: " + list(start.acceleration);
    }
    return text + "}\n";
  }

  Scene scene() const { return sceneFromText(yaml()); }

  /// The motion and its reaction.
  Sample at(double time) const {
    const double t = time * (1.0 / time_scale);
    const double u = ratio + swing * std::sin(0.7 * t);
    const double I = 0.5 * ((1.0 - std::cos(1.7 * t)) / 1.7 - (1.0 - std::cos(0.3 * t)) / 0.3);
    const double K =
        0.5 * ((t - std::sin(1.7 * t) / 1.7) / 1.7 - (t - std::sin(0.3 * t) / 0.3) / 0.3);
    double angle[2] = {1.0 + 5.0 * t + 0.5 * trend * t * t + 1.0 - std::cos(t),
                       2.0 + 5.0 * ratio * t + 0.5 * ratio * trend * t * t +
                           ratio * (1.0 - std::cos(t)) +
                           swing * trend * (t - std::sin(0.7 * t) / 0.7) / 0.7 + swing * K};
    double velocity[2] = {5.0 + trend * t + std::sin(t),
                          5.0 * ratio + ratio * trend * t + ratio * std::sin(t) +
                              swing * trend / 0.7 * (1.0 - std::cos(0.7 * t)) + swing * I};
    double acceleration[2] = {trend + std::cos(t), u * (trend + std::cos(t))};
    // J d = (-u, 1), scaled to d2 - u d1 = slip
    const double det = inertia[0] * inertia[1] - coupling * coupling;
    double d[2] = {(-u * inertia[1] - coupling) / det, (u * coupling + inertia[0]) / det};
    const double scale = slip / (d[1] - u * d[0]);
    const double tau = time_constant;
    const double x = t / tau;
    const double e = std::exp(-x);
    for (int i = 0; i < 2; ++i) {
      d[i] *= scale;
      if (order == 2) {
        angle[i] -= d[i] * tau * std::expm1(-x);
        velocity[i] += d[i] * e;
        acceleration[i] -= d[i] * e / tau;
      } else if (order == 3) {
        angle[i] += d[i] * tau * (-2.0 * std::expm1(-x) - x * e);
        velocity[i] += d[i] * (1.0 + x) * e;
        acceleration[i] -= d[i] * x * e / tau;
      }
    }
    const double L = hasReactionOfItsOwn() ? 0.0 : reaction;
    Sample sample;
    sample.time = time;
    for (int i = 0; i < 2; ++i) {
      sample.angle[i] = angle[i] * angle_scale;
      sample.velocity[i] = velocity[i] * angle_scale / time_scale;
      sample.acceleration[i] = acceleration[i] * angle_scale / (time_scale * time_scale);
    }
    const double torque_scale = inertia_scale * angle_scale / (time_scale * time_scale);
    sample.reaction_torque[1] = torque_scale * L * std::sin(t);
    sample.reaction_torque[0] =
        -torque_scale * L *
        (principle == Principle::kGauss ? u * std::sin(t) : ratio * std::sin(t) + swing * I);
    // the transient's own: J d is along (-u, 1)
    for (int i = 0; i < 2; ++i) {
      const double direction = inertia[i] * d[i] + coupling * d[1 - i];
      const double rate = order == 2 ? -e / tau : order == 3 ? -x * e / tau : 0.0;
      sample.reaction_torque[i] += torque_scale * direction * rate;
    }
    return sample;
  }

  Run exact(const std::vector<double>& times) const {
    return tabulate(times, [this](double t, Sample& sample) { sample = at(t); });
  }

  std::string label() const {
    std::string label = "order " + std::to_string(order);
    if (nonlinear) label += " nonlinear";
    label += std::string(", ") + toString(principle) + ", tau " + text(time_constant);
    if (swing == 0.0) label += ", constant ratio";
    if (slip != 0.0) label += ", transient";
    if (coupling != 0.0) label += ", coupled";
    if (harmonic != 0.0) label += ", J(phi)";
    return label;
  }
};

/// Of both principles and these orders, and of order 2 nonlinear ones, too.
inline std::vector<KnownMotion> knownMotions(const std::vector<int>& orders, bool with_nonlinear) {
  std::vector<KnownMotion> motions;
  for (const Principle principle : {Principle::kGeneralizedGauss, Principle::kGauss}) {
    for (const int order : orders) {
      KnownMotion motion;
      motion.principle = principle;
      motion.order = order;
      motions.push_back(motion);
      motion.nonlinear = true;
      if (with_nonlinear && order == 2) motions.push_back(motion);
    }
  }
  return motions;
}

/// Two shafts behind an elastic coupling, a third geared to the second one by `order` (0: none):
/// theta = phi1 - phi2 swings like a damped oscillator about m / (J1 w^2), and all of it turns.
struct ElasticDrive {
  int order = 0;
  Principle principle = Principle::kGeneralizedGauss;
  double stiffness = 1.0;
  double damping_ratio = 0.0;
  double motor = 3.0;    ///< torque on the first shaft, N m
  double turning = 4.0;  ///< speed of the centre at the start, rad/s

  static constexpr double kJ1 = 0.4;
  static constexpr double kJ2 = 0.7;
  static constexpr double kJ3 = 2.0;
  static constexpr double kGear = 0.5;

  double behind() const { return order == 0 ? kJ2 : kJ2 + kGear * kGear * kJ3; }
  double reduced() const { return kJ1 * behind() / (kJ1 + behind()); }
  /// Frequency of the swing without damping, rad/s.
  double frequency() const { return std::sqrt(stiffness / reduced()); }
  double damping() const { return 2.0 * damping_ratio * reduced() * frequency(); }

  std::string yaml() const {
    const Sample start = at(0.0);
    const int s = order == 0 ? 2 : 3;
    std::vector<std::string> elements = {
        "m on a: " + plainly(motor), "k = ElasticCoupling, shafts: [a, b], stiffness: " +
                                         plainly(stiffness) + ", damping: " + plainly(damping())};
    if (order > 0) elements.push_back("g" + ofOrder(order, "_3-0.5*_2"));
    const auto first = [&](const double* x) { return list({x, x + s}); };
    std::string initial =
        "initial: {angle: " + first(start.angle) + ", velocity: " + first(start.velocity);
    if (order == 3) initial += ", acceleration: " + first(start.acceleration);
    return sceneText(order == 0 ? "a 0.4, b 0.7" : "a 0.4, b 0.7, c 2", elements,
                     initial + "}\nprinciple: " + toString(principle));
  }

  /// The swing starts from theta = 0, theta' = 0.1.
  Sample at(double t) const {
    const double J2 = behind();
    const double w = frequency();
    const double z = damping_ratio;
    const double rest = motor / (kJ1 * w * w);
    // y = theta - rest: y'' + 2 z w y' + w^2 y = 0
    const double y0 = -rest;
    const double v0 = 0.1;
    double y;
    double v;
    if (z < 1.0) {
      const double d = w * std::sqrt(1.0 - z * z);
      const double e = std::exp(-z * w * t);
      const double b = (v0 + z * w * y0) / d;
      y = e * (y0 * std::cos(d * t) + b * std::sin(d * t));
      v = e * (v0 * std::cos(d * t) - (z * w * b + d * y0) * std::sin(d * t));
    } else if (z == 1.0) {
      const double e = std::exp(-w * t);
      y = e * (y0 + (v0 + w * y0) * t);
      v = e * (v0 - w * (v0 + w * y0) * t);
    } else {
      const double root = std::sqrt(z * z - 1.0);
      const double fast = -w * (z + root);
      const double slow = -w / (z + root);
      const double a = (v0 - slow * y0) / (fast - slow);
      const double b = (fast * y0 - v0) / (fast - slow);
      y = a * std::exp(fast * t) + b * std::exp(slow * t);
      v = a * fast * std::exp(fast * t) + b * slow * std::exp(slow * t);
    }
    const double swing = -2.0 * z * w * v - w * w * y;  // theta''
    const double sum = kJ1 + J2;
    // the centre: (J1 phi1 + J2 phi2) / (J1 + J2)
    const double center[3] = {0.5 * motor / sum * t * t + turning * t, motor / sum * t + turning,
                              motor / sum};
    const double theta[3] = {y + rest, v, swing};
    Sample sample;
    sample.time = t;
    double* columns[3] = {sample.angle, sample.velocity, sample.acceleration};
    for (int n = 0; n < 3; ++n) {
      columns[n][0] = center[n] + J2 / sum * theta[n];
      columns[n][1] = center[n] - kJ1 / sum * theta[n];
      columns[n][2] = kGear * columns[n][1];
    }
    return sample;
  }
};

/// Compares angles and velocities on the line `hazard`, accelerations on the line `accelerations`.
///
/// They are apart since the accelerations of `gauss` are no state but a function of t, angles and
/// velocities: an error of these comes through the slope of that function, which is 1/tau of a slip
/// or k/J of a coupling.
inline void compareApart(Hazard& hazard, Hazard& accelerations, const Run& run,
                         const Run& reference, const Scene& scene, const std::string& label,
                         double allowed = kAllowed) {
  const auto split = [&](const Run& whole, bool of_accelerations) {
    Run part = whole;
    for (Sample& sample : part.samples) {
      for (int i = 0; i < scene.shaftCount(); ++i) {
        if (of_accelerations) sample.velocity[i] = sample.acceleration[i];
        sample.acceleration[i] = 0.0;
      }
    }
    return part;
  };
  hazard.compare(split(run, false), split(reference, false), scene, label, allowed, Columns::kAll);
  accelerations.compare(split(run, true), split(reference, true), scene, label + ", accelerations",
                        allowed, Columns::kVelocity);
}

}  // namespace variator_sim::test
