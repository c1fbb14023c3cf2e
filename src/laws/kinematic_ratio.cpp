// A variator without slip whose ratio is imposed, order 1 (rad/s), on the shafts a and b:
//     f = omega_b - i(t) omega_a
// Source: Artobolevskii, Zinov'ev, Umnov: Equations of motion of a machine aggregate with a
// variator, Dokl. Akad. Nauk SSSR 173 (1967) no. 5, 1017-1020 (in Russian).
//
// Keys: `shafts` [a, b], `ratio` i (a number, a table over time, or commanded through
// `second_order_lag`: f is differentiated twice, and so is i).
#include <vector>

#include "variator_sim/laws.h"

namespace variator_sim {

void KinematicRatio::build(LawContext& scene) {
  const std::vector<Shaft> s = scene.shafts("shafts", 2);
  const Expression i = scene.quantity("ratio", Range::any("1"));
  scene.constrain(s[1].velocity - i * s[0].velocity);
  scene.output("ratio", i);
}

}  // namespace variator_sim
