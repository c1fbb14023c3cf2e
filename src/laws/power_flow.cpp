// Power into the masses of two shafts, order 2 (W). In one of two forms:
//     psi = J_a omega_a epsilon_a + J_b omega_b epsilon_b - P            imposed power P
//     psi = p_b - eta p_a  (p_a > 0),   p_b - p_a / eta  (p_a < 0)       efficiency eta
// where p_a = -J_a omega_a epsilon_a is the power that the mass of a gives and
// p_b = J_b omega_b epsilon_b the power that the mass of b takes. With P the kinetic energy of the
// two is T(0) + integral of P dt. With eta one mass is speeded up by the other, as in a flywheel
// drive, and the part 1 - eta of the power is lost in whichever direction it flows; the two
// branches are joined smoothly, p_0 wide:
//     psi = p_b - m p_a + n (sqrt(p_a^2 + p_0^2) - p_0),  m = (1/eta + eta)/2, n = (1/eta - eta)/2
// Both leave C = 0 at rest, where power decides nothing: the scene has to start in motion.
// Own formulation; J are those of the scene's shafts (constant inertia).
#include "variator_sim/laws.h"

namespace variator_sim {

void PowerFlow::build(LawContext& scene) {
  scene.keys({"power", "efficiency", "smoothing_power"});
  ParameterReader& parameters = scene.parameters();
  const std::vector<Shaft> s = scene.shafts("shafts", 2);
  const std::vector<double> J = parameters.numbers("inertias", 2, Range::positive("kg m^2"));
  const Expression given = -J[0] * s[0].velocity * s[0].acceleration;
  const Expression taken = J[1] * s[1].velocity * s[1].acceleration;
  scene.output("power_given", given);
  scene.output("power_taken", taken);
  if (!parameters.has("efficiency")) {
    if (parameters.has("smoothing_power")) {
      throw parameters.error("smoothing_power", "belongs to 'efficiency', which is not given");
    }
    scene.constrain(taken - given - scene.quantity("power", Range::any("W")));
    return;
  }
  if (parameters.has("power")) {
    throw parameters.error(
        "power", "and 'efficiency' are two forms of this constraint; allowed: one of them");
  }
  const Expression eta = scene.quantity("efficiency", Range{0.0, 1.0, false, true, "1"});
  const Expression p_0 = scene.quantity("smoothing_power", Range::positive("W"));
  scene.constrain(taken - 0.5 * (1.0 / eta + eta) * given +
                  0.5 * (1.0 / eta - eta) * (sqrt(given * given + p_0 * p_0) - p_0));
}

}  // namespace variator_sim
