/// A motor that swings at 100 rad/s, a clutch, a hub on a spring, and a car.
#pragma once

#include "support/scenes.h"

namespace variator_sim::test {

/// By dry friction of 80 N m, regularized within `speed`, rad/s.
inline std::string withDryClutch(const std::string& speed) {
  return sceneText(
      "flywheel 1, hub 0.05, car 1",
      {"motor on flywheel: 200*sin(100*t)",
       "clutch = Friction, shafts: [flywheel, hub], coulomb: 80, regularization_speed: " + speed,
       "spring = ElasticCoupling, shafts: [hub, car], stiffness: 160, damping: 1"},
      "principle: gauss\ninitial: {velocity: [100, 90, 90]}");
}

}  // namespace variator_sim::test
