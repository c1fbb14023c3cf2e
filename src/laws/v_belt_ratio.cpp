// An automatic V-belt variator, order 1 (rad/s), driving pulley a, driven pulley b:
//     f = omega_b - i omega_a,    i = i_1 + (i_2 - i_1) (1 + tanh y)/2,
//     y = ((omega_a/omega_0)^2 - 1 - M/M_0) / w
// The flyweights of the driving pulley press its sheaves together with a force that grows with
// omega_a^2; the spring of the driven pulley, and its cams with the load M, press back. At low
// speed the ratio is i_1 (starting), at high speed i_2; it stands half-way at omega_0 when nothing
// loads it; a load keeps it down. tanh is the smooth stop at both ends, w how gradual the way
// between them is. The structure (a first-order constraint whose ratio follows speed and load) is
// that of Pronin, Petrov, Balovnev: Equations of motion of an automatic V-belt variator of a motor
// vehicle, Avtomobil'naya promyshlennost' 1979 no. 9, 15-18 (in Russian); the law is our
// simplification.
#include <limits>

#include "variator_sim/laws.h"

namespace variator_sim {

void VBeltRatio::build(LawContext& scene) {
  scene.keys({"load", "load_torque"});
  ParameterReader& parameters = scene.parameters();
  const std::vector<Shaft> s = scene.shafts("shafts", 2);
  const Expression i_1 = scene.quantity("ratio_low", Range::positive("1"));
  const double least = i_1.isConstant() ? i_1.value() : 0.0;
  const Expression i_2 = scene.quantity(
      "ratio_high", Range{least, std::numeric_limits<double>::infinity(), false, true, "1"});
  const Expression speed = s[0].velocity / scene.quantity("speed", Range::positive("rad/s"));
  const Expression width = scene.quantity("width", Range::positive("1"), 0.5);
  Expression y = speed * speed - 1.0;
  if (parameters.has("load")) {
    y -= scene.quantity("load", Range::any("N m")) /
         scene.quantity("load_torque", Range::positive("N m"));
  } else if (parameters.has("load_torque")) {
    throw parameters.error("load_torque", "belongs to 'load', which is not given");
  }
  const Expression i = i_1 + 0.5 * (i_2 - i_1) * (1.0 + tanh(y / width));
  scene.constrain(s[1].velocity - i * s[0].velocity);
  scene.output("ratio", i);
}

}  // namespace variator_sim
