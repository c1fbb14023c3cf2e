// A propeller (or a fan), positive speed ahead. With w = omega (rad/s), n = w/(2 pi) (1/s) and
// a(x) the magnitude of x:
//     Q  = -k w a(w),   k = rho K_Q0 D^5 / (2 pi)^2               (bollard condition)       N m
//     Q  = -k w a(w) + m a(w),   m = rho K_Q1 V D^4 / (2 pi)      (water coming in at V)    N m
// The second is Q = -rho D^5 n |n| K_Q(J) with K_Q(J) = K_Q0 - K_Q1 J, J = V/(n D), in the
// bilinear form that is regular at n = 0. Source: Fossen: Handbook of Marine Craft Hydrodynamics
// and Motion Control (2011), section 9.1; after Blanke (1981).
//
// a(w) = |w| exactly by default: the rate is then continuous, with a kink at w = 0 where the shaft
// turns round (but for an inflow, where it would jump: there w_0 has to be given). With a
// `regularization_speed` w_0 > 0 the law is smooth, a(w) = w^2/sqrt(w^2 + w_0^2), and differs from
// the exact one by the part (w_0/w)^2/2.
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

/// K_Q1 V
Expression readAdvance(LawContext& scene) {
  ParameterReader section = scene.parameters().section("advance", {"speed", "slope"});
  const Expression V = scene.quantity(section, "speed", Range::any("m/s"));
  const Expression K_Q1 = scene.quantity(section, "slope", Range::notNegative("1"));
  section.finish();
  return K_Q1 * V;
}

}  // namespace

void Propeller::build(LawContext& scene) {
  scene.keys({"shaft", "regularization_speed"});
  ParameterReader& parameters = scene.parameters();
  const Shaft shaft = scene.shaft("shaft");
  const Expression w = shaft.velocity;
  const bool has_advance = parameters.has("advance");
  Expression k;
  Expression m = 0.0;
  if (parameters.has("coefficient") || !parameters.has("torque_coefficient")) {
    scene.keys({"coefficient"});
    k = scene.quantity("coefficient", Range::notNegative("N m s^2/rad^2"));
  } else {
    scene.keys({"torque_coefficient", "diameter", "density", "advance"});
    constexpr double turn = 2.0 * 3.14159265358979323846;
    const Expression K_Q0 = scene.quantity("torque_coefficient", Range::notNegative("1"));
    const double D = scene.number("diameter", Range::positive("m"));
    const Expression density = scene.quantity("density", Range::positive("kg/m^3"), 1025.0);
    k = density * K_Q0 * (D * D * D * D * D / (turn * turn));
    if (has_advance) m = density * readAdvance(scene) * (D * D * D * D / turn);
  }
  const Range speeds = has_advance ? Range::positive("rad/s") : Range::notNegative("rad/s");
  const double w_0 = has_advance ? scene.number("regularization_speed", speeds)
                                 : scene.number("regularization_speed", speeds, 0.0);
  const Expression a = w_0 > 0.0 ? w * w / sqrt(w * w + w_0 * w_0) : abs(w);
  scene.apply(shaft, -(k * w - m) * a);
}

}  // namespace variator_sim
