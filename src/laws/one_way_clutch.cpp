// A freewheel: b may overrun a, through a gear of the ratio i, but not the other way round; on one
// shaft it may turn forward only. With w = i omega_b - omega_a or w = omega:
//     forward  w > 0:  T = c
//     stuck    w = 0:  T <= p c is what holds it                           N m
//     Q_a += T,   Q_b += -i T;   on one shaft Q += -T.
// A state with w < 0 becomes one with w = 0 by an impact.
#include "laws/gear_keys.h"
#include "variator_sim/laws.h"

namespace variator_sim {

void OneWayClutch::build(LawContext& scene) {
  scene.keys({"shaft", "shafts", "ratio", "capacity", "static", "initial"});
  Holding freewheel;
  const Expression capacity = scene.quantity("capacity", Range::notNegative("N m"), 0.0);
  freewheel.slip = readSlip(scene);
  freewheel.side = scene.side();
  // (A formula below 0 would drive.)
  const Expression drag = capacity.isConstant() ? capacity : max(capacity, 0.0);
  freewheel.torque = drag * freewheel.side;
  freewheel.upper = scene.quantity("static", Range::atLeast(1.0, "1"), 1.0) * drag;
  freewheel.slides_backward = false;
  freewheel.begins = readBegin(scene);
  scene.hold(freewheel);
}

}  // namespace variator_sim
