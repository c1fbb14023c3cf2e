#include "model/check_point.h"

#include <algorithm>
#include <cmath>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {
namespace {

double shaken(double value, double by, Random& random) {
  return value + by * std::max(1.0, std::abs(value)) * random();
}

}  // namespace

CheckPoint moved(const CheckPoint& from, const CheckPoint& direction, double h) {
  CheckPoint to = from;
  to.time += h * direction.time;
  const auto add = [h](auto& values, const auto& rates) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += h * rates[i];
  };
  add(to.angle, direction.angle);
  add(to.velocity, direction.velocity);
  add(to.acceleration, direction.acceleration);
  add(to.input, direction.input);
  add(to.input_rate, direction.input_rate);
  return to;
}

CheckPoint scaled(const CheckPoint& point, double of_place, double of_motion) {
  CheckPoint to = point;
  to.time *= of_place;
  for (double& value : to.angle) value *= of_place;
  for (double& value : to.velocity) value *= of_motion;
  for (double& value : to.acceleration) value *= of_motion;
  return to;
}

CheckPoint motionOf(const CheckPoint& point) {
  CheckPoint rate;
  rate.time = 1.0;
  rate.angle = point.velocity;
  rate.velocity = point.acceleration;
  rate.input = point.input_rate;
  rate.input_rate = point.input_second_rate;
  return rate;
}

double largestEntry(const CheckPoint& direction) {
  double largest = std::abs(direction.time);
  const auto see = [&largest](const auto& values) {
    for (const double value : values) largest = std::max(largest, std::abs(value));
  };
  see(direction.angle);
  see(direction.velocity);
  see(direction.acceleration);
  see(direction.input);
  see(direction.input_rate);
  return largest;
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
  return p;
}

std::string describe(double value) {
  return ParameterTree::real(value).toText();
}

std::string describe(const Scene& scene, const CheckPoint& p) {
  const auto list = [](const auto& values, int count) {
    std::string text = "[";
    for (int i = 0; i < count; ++i) {
      text += (i == 0 ? "" : ", ") + describe(values[static_cast<std::size_t>(i)]);
    }
    return text + "]";
  };
  const int s = scene.shaftCount();
  std::string text = "t = " + describe(p.time) + ", angle = " + list(p.angle, s) +
                     ", velocity = " + list(p.velocity, s) +
                     ", acceleration = " + list(p.acceleration, s);
  if (scene.inputCount() > 0) {
    text += ", input = " + list(p.input, scene.inputCount()) +
            ", input rate = " + list(p.input_rate, scene.inputCount());
  }
  return text;
}

}  // namespace variator_sim
