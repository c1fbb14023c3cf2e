// The accelerations of two shafts on a circle, order 2 (rad^2/s^4):
//     psi = epsilon_a^2 + epsilon_b^2 - a^2
// The simplest constraint that is nonlinear in the accelerations; its motion is known in closed
// form (doc/theory.md). A start at rest needs `initial/acceleration`, or torques that decide where
// on the circle it begins.
#include "variator_sim/laws.h"

namespace variator_sim {

void AccelerationMagnitude::build(LawContext& scene) {
  const std::vector<Shaft> s = scene.shafts("shafts", 2);
  const Expression a = scene.quantity("magnitude", Range::positive("rad/s^2"));
  scene.constrain(s[0].acceleration * s[0].acceleration + s[1].acceleration * s[1].acceleration -
                  a * a);
}

}  // namespace variator_sim
