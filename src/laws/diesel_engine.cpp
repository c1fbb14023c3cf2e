// A Diesel engine in the mean over its cycles: the full-load torque of a table over the speed
// times the rack (the part of full fuel, 0 to 1), less the friction; an idle governor may add
// rack.
//     Q   = r T(w) - F(w)                                          N m,   w = omega, rad/s
//     r   = u + (1 - u) g(w)                                       rack in force, from u to 1
//     g   = 1 - S((w - w_i + b) / (2 b))                           idle governor: 1 below w_i - b,
//                                                                  1/2 at w_i, 0 above w_i + b
//     F   = F_0 tanh(w/w_0) + F_1 w
// S is the step of degree five, so Q is two times continuously differentiable: the table is
// (table.h), it does not overshoot, and beyond its ends it keeps its first and its last value. The
// law does not stall the engine: let the table fall to 0 towards speed 0, and towards the speed at
// which the fuel is cut.
//
// Source: Guzzella, Onder: Introduction to Modeling and Control of Internal Combustion Engine
// Systems (2010), chapter 2 (mean values, friction over speed); the smooth governor is ours.
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

/// F = F_0 tanh(w/w_0) + F_1 w
Expression readFriction(LawContext& scene, const Expression& w) {
  ParameterReader section =
      scene.parameters().section("friction", {"constant", "linear", "regularization_speed"});
  const Expression F_0 = scene.quantity(section, "constant", Range::notNegative("N m"));
  const Expression F_1 = scene.quantity(section, "linear", Range::notNegative("N m s/rad"), 0.0);
  const Expression w_0 =
      scene.quantity(section, "regularization_speed", Range::positive("rad/s"), 1.0);
  section.finish();
  return F_0 * tanh(w / w_0) + F_1 * w;
}

/// S = 1 - g
Expression readGovernor(LawContext& scene, const Expression& w) {
  ParameterReader section = scene.parameters().section("idle_governor", {"speed", "band"});
  const double speed = section.number("speed", Range::positive("rad/s"));
  const double band = section.number("band", Range::positive("rad/s"));
  section.finish();
  return scene.smoothStep(w, speed - band, speed + band);
}

}  // namespace

void DieselEngine::build(LawContext& scene) {
  scene.keys({"shaft", "full_load", "rack", "friction", "idle_governor"});
  ParameterReader& parameters = scene.parameters();
  const Shaft shaft = scene.shaft("shaft");
  const Expression w = shaft.velocity;
  ParameterReader full_load = parameters.section("full_load");
  const Table T = Table::read(
      full_load, {{"speed", Range::any("rad/s")}, {"torque", Range::notNegative("N m")}},
      Table::Beyond::kConstant);
  full_load.finish();
  Expression r = scene.quantity("rack", Range::between(0.0, 1.0, "1"));
  // r = u + (1 - u) g = 1 - (1 - u) S
  if (parameters.has("idle_governor")) r = 1.0 - (1.0 - r) * readGovernor(scene, w);
  scene.output("rack", r);
  Expression F = 0.0;
  if (parameters.has("friction")) F = readFriction(scene, w);
  scene.apply(shaft, r * scene.lookUp(T, w) - F);
}

}  // namespace variator_sim
