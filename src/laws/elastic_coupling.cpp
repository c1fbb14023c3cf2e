// A massless elastic link with damping between the shafts a and b, through an ideal gear of the
// ratio i (the link is at rest where phi_a = i phi_b):
//     T  = k (phi_a - i phi_b) + c (omega_a - i omega_b)          N m
//     Q_a += -T,   Q_b += i T.
// It takes the power c (omega_a - i omega_b)^2 >= 0 out of the drivetrain; the rest it stores in
// k (phi_a - i phi_b)^2 / 2. To the ground the angle of one shaft is the twist.
//
// With a gap g, the whole play, the link is in contact where q = |twist| - g/2 > 0, and pushes
// only:
//     T = +-(k q + clamp(c q', -k q, k q)),
// continuous at the contact, with at most twice the torque of the spring.
//
// Source: the Kelvin-Voigt link of torsional vibration; Dresig, Holzweissig: Dynamics of Machinery
// (2010), chapter 4.
#include "laws/gear_keys.h"
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

/// The torque of a contact that is pressed in by q at the rate v.
Expression push(const Expression& q, const Expression& v, const Expression& k,
                const Expression& c) {
  const Expression spring = k * max(q, 0.0);
  return spring + clamp(c * v, -spring, spring);
}

}  // namespace

void ElasticCoupling::build(LawContext& scene) {
  scene.keys({"shaft", "shafts", "stiffness", "damping", "ratio", "gap"});
  const bool is_grounded = scene.parameters().has("shaft");
  std::vector<Shaft> shafts;
  if (is_grounded) {
    shafts = {scene.shaft("shaft")};
  } else {
    shafts = scene.shafts("shafts", 2);
  }
  const Expression k = scene.quantity("stiffness", Range::positive("N m/rad"));
  const Expression c = scene.quantity("damping", Range::notNegative("N m s/rad"), 0.0);
  const Expression i = is_grounded ? Expression(1.0) : readRatio(scene);
  const Expression twist = is_grounded ? shafts[0].angle : shafts[0].angle - i * shafts[1].angle;
  const Expression rate =
      is_grounded ? shafts[0].velocity : shafts[0].velocity - i * shafts[1].velocity;
  Expression T = k * twist + c * rate;
  if (scene.parameters().has("gap")) {
    const Expression half = 0.5 * scene.quantity("gap", Range::notNegative("rad"));
    T = push(twist - half, rate, k, c) - push(-twist - half, -rate, k, c);
  }
  scene.apply(shafts[0], -T);
  if (!is_grounded) scene.apply(shafts[1], i * T);
  scene.output("twist", twist);
  scene.output("transmitted_torque", T);
}

}  // namespace variator_sim
