// A massless elastic link with damping between the shafts a and b, through an ideal gear of the
// ratio i (the link is at rest where phi_a = i phi_b):
//     T  = k (phi_a - i phi_b) + c (omega_a - i omega_b)          N m
//     T' = k (omega_a - i omega_b) + c (epsilon_a - i epsilon_b)  N m/s
//     Q_a += -T,   Q_b += i T.
// It takes the power c (omega_a - i omega_b)^2 >= 0 out of the drivetrain; the rest it stores in
// k (phi_a - i phi_b)^2 / 2.
//
// Keys: `shafts` [a, b], `stiffness` k > 0 (N m/rad), `damping` c >= 0 (N m s/rad, default 0),
// `ratio` i, not 0 (default 1; negative: the shafts turn against each other).
//
// Source: the Kelvin-Voigt link of torsional vibration; Dresig, Holzweissig: Dynamics of Machinery
// (2010), chapter 4.
#include <vector>

#include "laws/ratio.h"
#include "variator_sim/laws.h"

namespace variator_sim {

void ElasticCoupling::build(LawContext& scene) {
  scene.keys({"shafts", "stiffness", "damping", "ratio"});
  const std::vector<Shaft> shafts = scene.shafts("shafts", 2);
  const Expression k = scene.quantity("stiffness", Range::positive("N m/rad"));
  const Expression c = scene.quantity("damping", Range::notNegative("N m s/rad"), 0.0);
  const Expression i = readRatio(scene);
  const Expression twist = shafts[0].angle - i * shafts[1].angle;
  const Expression T = k * twist + c * (shafts[0].velocity - i * shafts[1].velocity);
  scene.apply(shafts[0], -T);
  scene.apply(shafts[1], i * T);
  scene.output("twist", twist);
  scene.output("transmitted_torque", T);
}

}  // namespace variator_sim
