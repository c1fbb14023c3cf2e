// An acceleration that follows its target with limited jerk, order 3 (rad/s^3):
//     eta = j tanh((a - epsilon) / (j tau))
// Near the target a it approaches like exp(-t/tau); far away the jerk is +-j. A target that steps
// is thus a start without a jolt. After the kinematically controlled starts of Arkhangel'skii and
// Gorin (see ImposedJerk); the law is our choice.
#include "variator_sim/laws.h"

namespace variator_sim {

void JerkLimit::build(LawContext& scene) {
  const Shaft shaft = scene.shaft("shaft");
  const Expression j = scene.quantity("limit", Range::positive("rad/s^3"));
  const Expression tau = scene.quantity("time_constant", Range::positive("s"));
  const Expression a = scene.quantity("acceleration", Range::any("rad/s^2"));
  scene.constrain(shaft.jerk - j * tanh((a - shaft.acceleration) / (j * tau)));
}

}  // namespace variator_sim
