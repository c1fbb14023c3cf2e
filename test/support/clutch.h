/// A motor that swings at 100 rad/s, a clutch, a hub on a spring, and a car.
#pragma once

#include <string>

namespace variator_sim::test {

/// `clutch` is the line of the torque of that name.
inline std::string withClutch(const std::string& clutch) {
  return R"yaml(
shafts: [flywheel, hub, car]
flywheel: {inertia: 1}
hub: {inertia: 0.05}
car: {inertia: 1}
torques: [motor, clutch, spring]
motor: {type: variator_sim/ExpressionTorque, shaft: flywheel, torque: "200*sin(100*t)"}
spring: {type: variator_sim/ElasticCoupling, shafts: [hub, car], stiffness: 160, damping: 1}
principle: gauss
initial: {velocity: [100, 90, 90]}
)yaml" + clutch;
}

/// By dry friction of 80 N m, regularized within `speed`, rad/s.
inline std::string withDryClutch(const std::string& speed) {
  return withClutch(
      "clutch: {type: variator_sim/Friction, shafts: [flywheel, hub], coulomb: 80, "
      "regularization_speed: " +
      speed + "}\n");
}

}  // namespace variator_sim::test
