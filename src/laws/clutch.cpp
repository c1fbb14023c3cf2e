// A friction clutch between the shafts a and b through a gear of the ratio i, and a brake between a
// shaft and the ground, by Coulomb's law, with w = i omega_b - omega_a or w = omega:
//     free    c <= 0:  T = 0
//     slides           T = c sign(w)
//     stuck   w = 0:   T in [-p c, p c] is what holds it                  N m
//     Q_a += T,   Q_b += -i T;   of a brake Q += -T.
// Sliding, it takes the power T w >= 0 out of the drivetrain.
//
// Source: Otter, Elmqvist, Mattsson: Hybrid modeling in Modelica based on the synchronous data flow
// principle, CACSD 1999; the limits and what follows behind them are those of Coulomb's law alone.
#include "laws/gear_keys.h"
#include "variator_sim/laws.h"

namespace variator_sim {
namespace {

void buildCoulomb(LawContext& scene) {
  Holding clutch;
  const Expression capacity = scene.quantity("capacity", Range::notNegative("N m"));
  const Expression limit = scene.quantity("static", Range::atLeast(1.0, "1"), 1.0) * capacity;
  clutch.slip = readSlip(scene);
  clutch.side = scene.side();
  clutch.torque = capacity * clutch.side;
  clutch.upper = limit;
  clutch.lower = -limit;
  clutch.level = capacity;
  clutch.begins = readBegin(scene);
  scene.hold(clutch);
}

}  // namespace

void Clutch::build(LawContext& scene) {
  scene.keys({"shafts", "ratio", "capacity", "static", "initial"});
  scene.parameters().require("shafts",
                             "two shafts (a brake against the ground: variator_sim/Brake)");
  buildCoulomb(scene);
}

void Brake::build(LawContext& scene) {
  scene.keys({"shaft", "capacity", "static", "initial"});
  scene.parameters().require("shaft", "a shaft (between two shafts: variator_sim/Clutch)");
  buildCoulomb(scene);
}

}  // namespace variator_sim
