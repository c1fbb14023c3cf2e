// The torque of a machine tool's cut on its spindle, with a smooth entry and exit:
//     Q  = -T E(t) P(phi) s(omega)                                                  N m
//     E  = S((t - t_b)/h) - S((t - t_e)/h)                     engagement in time, 0 to 1
//     P  = 1 + a sin(z phi + beta)                             passing teeth
//     s  = tanh(omega/w_0)                                     a cut resists, it never drives
// S(x) = 10 x^3 - 15 x^4 + 6 x^5 between 0 and 1: two times continuously differentiable. The cut
// enters from t_b to t_b + h and leaves from t_e to t_e + h; without `end` it does not leave.
//
// Source: Altintas: Manufacturing Automation (2012), chapter 2 (mean torque and tooth passing in
// milling); T by Kienzle's law, VDI-Zeitschrift 94 (1952) 299: T = k_c1.1 b h^(1-m) d/2.
#include <cmath>

#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

/// a sin(z phi + beta)
Expression readToothPassing(LawContext& scene, const Expression& angle) {
  ParameterReader section =
      scene.parameters().section("tooth_passing", {"teeth", "amplitude", "phase"});
  const double teeth = section.integer("teeth", 1, 10000);
  const Expression amplitude = scene.quantity(section, "amplitude", Range::between(0.0, 1.0, "1"));
  double phase = section.number("phase", Range::any("rad"), 0.0);
  // Added to a large phase the angle would be lost in rounding.
  if (std::abs(phase) > 4.0) phase = std::atan2(std::sin(phase), std::cos(phase));
  section.finish();
  return amplitude * sin(teeth * angle + phase);
}

}  // namespace

void CuttingTorque::build(LawContext& scene) {
  scene.keys({"shaft", "torque", "begin", "ramp", "end", "tooth_passing", "regularization_speed"});
  ParameterReader& parameters = scene.parameters();
  const Shaft shaft = scene.shaft("shaft");
  const Expression T = scene.quantity("torque", Range::notNegative("N m"));
  const double begin = scene.number("begin", Range::any("s"));
  const double ramp = scene.number("ramp", Range::positive("s"));
  Expression E = scene.smoothStep(scene.time(), begin, begin + ramp);
  if (parameters.has("end")) {
    const double end = scene.number("end", Range::atLeast(begin + ramp, "s"));
    E -= scene.smoothStep(scene.time(), end, end + ramp);
  }
  Expression P = 1.0;
  if (parameters.has("tooth_passing")) P += readToothPassing(scene, shaft.angle);
  const Expression w_0 = scene.quantity("regularization_speed", Range::positive("rad/s"), 0.1);
  scene.apply(shaft, -T * E * P * tanh(shaft.velocity / w_0));
}

}  // namespace variator_sim
