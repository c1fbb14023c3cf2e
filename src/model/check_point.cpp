#include "model/check_point.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {
namespace {

double shaken(double value, double by, Random& random) {
  return value + by * std::max(1.0, std::abs(value)) * random();
}

}  // namespace

CheckPoint scaled(const CheckPoint& point, double of_place, double of_motion) {
  CheckPoint to = point;
  to.time *= of_place;
  for (double& value : to.angle) value *= of_place;
  for (double& value : to.velocity) value *= of_motion;
  for (double& value : to.acceleration) value *= of_motion;
  return to;
}

CheckPoint shaken(const Scene& scene, const CheckPoint& point, double by, Random& random) {
  CheckPoint p = point;
  p.time = std::abs(shaken(p.time, by, random));
  for (std::size_t i = 0; i < scene.shafts.size(); ++i) {
    p.angle[i] = shaken(p.angle[i], by, random);
    p.velocity[i] = shaken(p.velocity[i], by, random);
    p.acceleration[i] = shaken(p.acceleration[i], by, random);
  }
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) {
    const CommandInputSettings& settings = scene.inputs[i];
    p.input[i] = std::clamp(shaken(p.input[i], by, random), settings.minimum, settings.maximum);
    p.input_rate[i] = shaken(p.input_rate[i], by, random);
    if (settings.hold == Hold::kSecondOrderLag) {
      p.input_second_rate[i] = shaken(p.input_second_rate[i], by, random);
    }
  }
  return p;
}

CheckPoint startOf(const Scene& scene) {
  CheckPoint p;
  std::copy(scene.initial.angle.begin(), scene.initial.angle.end(), p.angle.begin());
  std::copy(scene.initial.velocity.begin(), scene.initial.velocity.end(), p.velocity.begin());
  std::copy(scene.initial.acceleration.begin(), scene.initial.acceleration.end(),
            p.acceleration.begin());
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) p.input[i] = scene.inputs[i].initial;
  std::fill(p.input.begin() + kMaxInputs, p.input.end(), 1.0);
  return p;
}

}  // namespace variator_sim
