// A friction variator with its characteristic, order 2 (rad/s), driving shaft a, driven shaft b:
//     psi = omega_b - i omega_a (1 - s(M)),     s = s_n sinh(g M/M_n)/sinh(g),
//     M = J_b epsilon_b + L + k omega_b |omega_b|
// M is the torque transmitted to b, as its acceleration shows it: the torque that accelerates its
// inertia J_b plus its known load. The slip s grows in proportion to M at first and ever faster
// towards the limit of traction; s_n is the slip at the nominal torque M_n, g how sharply it bends.
// psi is nonlinear in epsilon_b. |omega_b| is omega_b^2/sqrt(omega_b^2 + omega_r^2), smooth.
// C = i omega_a ds/dM J_b vanishes at omega_a = 0: the scene starts in motion. If the speeds change
// fast, put elastic links between the variator and the other masses. After Mal'tsev: Stability of
// motion of a stepless drive with regard to the variator's characteristic and the elasticity of
// links, Theory of mechanisms and machines 29 (Kharkov 1980), 121-125 (in Russian): the idea of the
// characteristic; the formula is our choice.
#include "variator_sim/laws.h"

namespace variator_sim {

void TractionCurve::build(LawContext& scene) {
  const std::vector<Shaft> s = scene.shafts("shafts", 2);
  const Expression w = s[1].velocity;
  const Expression i = scene.quantity("ratio", Range::any("1"));
  const Expression J_b = scene.quantity("inertia", Range::positive("kg m^2"));
  const Expression g = scene.quantity("sharpness", Range{0.0, 100.0, false, true, "1"}, 2.0);
  const Expression s_n = scene.quantity("nominal_slip", Range{0.0, 1.0, false, false, "1"});
  const Expression M_n = scene.quantity("nominal_torque", Range::positive("N m"));
  const Expression L = scene.quantity("load", Range::any("N m"), 0.0);
  const Expression k = scene.quantity("load_square", Range::notNegative("N m s^2/rad^2"), 0.0);
  const Expression w_r = scene.quantity("regularization_speed", Range::positive("rad/s"), 0.1);
  Expression M = J_b * s[1].acceleration + L;
  if (!(k.isConstant() && k.value() == 0.0)) M += k * w * w * w / sqrt(w * w + w_r * w_r);
  const Expression slip = s_n / sinh(g) * sinh(M * (g / M_n));
  scene.constrain(w - i * s[0].velocity * (1.0 - slip));
  scene.output("ratio", i);
  scene.output("slip", slip);
  scene.output("transmitted_torque", M);
}

}  // namespace variator_sim
