// A clutch of claws between the shafts a and b through a gear of the ratio i: open, or closed with
//     i omega_b - omega_a = 0
// whatever torque that needs. It closes while it is engaged and the slip is low, by an impact, and
// opens when it is no longer engaged.
#include "laws/gear_keys.h"
#include "variator_sim/laws.h"

namespace variator_sim {

void DogClutch::build(LawContext& scene) {
  scene.keys({"shafts", "ratio", "engaged", "engage_below"});
  scene.parameters().require("shafts", "two shafts");
  Holding claws;
  claws.slip = readSlip(scene);
  claws.side = scene.side();
  claws.level = scene.quantity("engaged") - 0.5;
  claws.closes_below = scene.number("engage_below", Range::positive("rad/s"));
  scene.hold(claws);
}

}  // namespace variator_sim
