// Coulomb, Stribeck and viscous friction, between a shaft and the ground (w = omega) or between
// two shafts through a gear of the ratio i (w = omega_a - i omega_b); i = 1 is a slipping clutch:
//     T(w) = (T_c + (T_s - T_c) exp(-(w/w_s)^2)) sign(w) + b w      N m
//     |T|  <= T_s where it sticks, w = 0
//     Q_a += -T,   Q_b += i T.
// Without w_s the torque that slides is T_c at every speed. With `regularization_speed` w_0
// tanh(w/w_0) stands for the sign, so that T is infinitely smooth and nothing sticks: below its
// limit a load creeps with about w_0 times its part of T_s, and the time constant of a shaft with
// inertia J is about J w_0/T_s there: choose w_0 with regard to both. It takes the power T w >= 0
// out of the drivetrain.
//
// Source: Armstrong-Helouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and
// compensation methods for the control of machines with friction, Automatica 30 (1994) 1083-1138.
#include <algorithm>
#include <cmath>

#include "laws/gear_keys.h"
#include "model/number_text.h"
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

/// T_s is never reached if tanh still rises while the exponential falls.
void checkPeak(LawContext& scene, double T_c, double T_s, double w_s, double w_0) {
  double peak = 0.0;
  double x = 0.01;    // w/w_0
  while (x < 20.0) {  // tanh(20) is 1
    x *= 1.02;
    const double w = x * w_0 / w_s;
    peak = std::max(peak, (T_c + (T_s - T_c) * std::exp(-w * w)) * std::tanh(x));
  }
  if (peak >= T_c + 0.9 * (T_s - T_c)) return;
  const auto path = [&](const char* key) { return scene.parameters().keyPath(key); };
  scene.warn(printed(
      "%s: %g N m are never reached, the torque's peak is %.4g N m: the sign is smoothed over %s, "
      "%g rad/s, and %s is only %g rad/s; '%s: %.1g' comes near",
      path("static").c_str(), T_s, peak, path("regularization_speed").c_str(), w_0,
      path("stribeck_speed").c_str(), w_s, path("regularization_speed").c_str(), w_s / 30.0));
}

void holdByFriction(LawContext& scene, const Expression& w, const Expression& level,
                    const Expression& T_s, const Expression& b) {
  Holding friction;
  friction.slip = w;
  friction.side = scene.side();
  friction.torque = level * friction.side + b * w;
  friction.upper = T_s;
  friction.lower = -T_s;
  friction.level = T_s;
  scene.hold(friction);
}

}  // namespace

void Friction::build(LawContext& scene) {
  scene.keys({"coulomb", "static", "stribeck_speed", "viscous", "regularization_speed"});
  ParameterReader& parameters = scene.parameters();
  const bool is_coupling = parameters.has("shafts");
  std::vector<Shaft> shafts;
  Expression i = 1.0;
  if (is_coupling) {
    scene.keys({"shafts", "ratio"});
    shafts = scene.shafts("shafts", 2);
    i = readRatio(scene);
  } else {
    scene.keys({"shaft"});
    shafts = {scene.shaft("shaft")};
  }
  const Expression w =
      is_coupling ? shafts[0].velocity - i * shafts[1].velocity : shafts[0].velocity;
  const Expression coulomb = scene.quantity("coulomb", Range::notNegative("N m"), 0.0);
  const bool sticks = !parameters.has("regularization_speed");
  Expression level = coulomb;
  Expression T_s = coulomb;
  Expression w_s;
  if (parameters.has("static")) {
    const double least = coulomb.isConstant() ? coulomb.value() : 0.0;
    T_s = scene.quantity("static", Range::atLeast(least, "N m"));
    if (!sticks || parameters.has("stribeck_speed")) {
      w_s = scene.quantity("stribeck_speed", Range::positive("rad/s"));
      const Expression x = w / w_s;
      level += (T_s - coulomb) * exp(-(x * x));
    }
  } else if (parameters.has("stribeck_speed")) {
    throw parameters.error("stribeck_speed",
                           "belongs to 'static', which is missing; allowed: both or neither");
  }
  const Expression b = scene.quantity("viscous", Range::notNegative("N m s/rad"), 0.0);
  if (sticks && (!T_s.isConstant() || T_s.value() > 0.0)) {
    holdByFriction(scene, w, level, T_s, b);
    return;
  }
  const Expression w_0 =
      sticks ? 1.0 : scene.quantity("regularization_speed", Range::positive("rad/s"));
  if (parameters.has("static") && coulomb.isConstant() && T_s.isConstant() && w_s.isConstant() &&
      w_0.isConstant()) {
    checkPeak(scene, coulomb.value(), T_s.value(), w_s.value(), w_0.value());
  }
  const Expression T = level * tanh(w / w_0) + b * w;
  scene.apply(shafts[0], -T);
  if (is_coupling) scene.apply(shafts[1], i * T);
  scene.output("slip", w);
  scene.output("transmitted_torque", T);
}

}  // namespace variator_sim
