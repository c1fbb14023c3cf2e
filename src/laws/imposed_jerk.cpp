// A kinematically controlled start, order 3 (rad/s^3): the jerk of one shaft is a given function
// of time,
//     eta - j(t) = 0.
// Either j as it is, or the smooth start that changes the speed by Delta within T from t_0 on,
//     epsilon = (Delta/T) (1 - cos z),  j = (2 pi Delta/T^2) sin z,  z = 2 pi (t - t_0)/T,
// with no acceleration at both ends; before and after j = 0, so the shaft keeps the acceleration
// it has (its initial one, if that is not 0). After Arkhangel'skii, Gorin: Questions of finding
// optimal motions of kinematically controlled systems, in: Stepless transmissions, Yaroslavl 1984,
// 54-58 (in Russian): the idea; the profile is our choice.
#include "variator_sim/laws.h"

namespace variator_sim {

void ImposedJerk::build(LawContext& scene) {
  scene.keys({"jerk", "velocity_change", "duration", "start"});
  ParameterReader& parameters = scene.parameters();
  const Shaft shaft = scene.shaft("shaft");
  if (!parameters.has("velocity_change")) {
    for (const char* key : {"duration", "start"}) {
      if (parameters.has(key)) {
        throw parameters.error(key, "belongs to 'velocity_change', which is not given");
      }
    }
    scene.constrain(shaft.jerk - scene.quantity("jerk", Range::any("rad/s^3")));
    return;
  }
  if (parameters.has("jerk")) {
    throw parameters.error(
        "jerk",
        "and 'velocity_change' are two forms of this constraint; allowed: one of "
        "them");
  }
  constexpr double kTwoPi = 6.283185307179586;
  const Expression change = scene.quantity("velocity_change", Range::any("rad/s"));
  const double T = scene.number("duration", Range::positive("s"));
  const double start = scene.number("start", Range::notNegative("s"), 0.0);
  // Before and after, z rests at a zero of its sine.
  const Expression z = clamp((scene.time() - start) * (kTwoPi / T), 0.0, kTwoPi);
  scene.constrain(shaft.jerk - kTwoPi / (T * T) * change * sin(z));
}

}  // namespace variator_sim
