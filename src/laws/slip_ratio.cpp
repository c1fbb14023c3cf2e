// A variator whose slip relaxes, order 2 (rad/s), on the shafts a and b:
//     psi = tau (epsilon_b - i epsilon_a) + omega_b - i omega_a
// With i constant the slip omega_b - i omega_a decays as exp(-t/tau), whatever the torques. A
// commanded i that jumps moves the accelerations as a jump of torque does: tau > 0 leaves the
// speeds as they are. Own formulation: slip of first order, the simplest law linear in epsilon.
#include "variator_sim/laws.h"

namespace variator_sim {

void SlipRatio::build(LawContext& scene) {
  const std::vector<Shaft> s = scene.shafts("shafts", 2);
  const Expression tau = scene.quantity("time_constant", Range::positive("s"));
  const Expression i = scene.quantity("ratio", Range::any("1"));
  const Expression slip = s[1].velocity - i * s[0].velocity;
  scene.constrain(tau * (s[1].acceleration - i * s[0].acceleration) + slip);
  scene.output("slip", slip);
  scene.output("ratio", i);
}

}  // namespace variator_sim
