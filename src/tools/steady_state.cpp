#include "tools/steady_state.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "variator_sim/errors.h"
#include "variator_sim/linear_model.h"

namespace variator_sim {

MotionState makeState(const OperatingPoint& point, const Scene& scene) {
  MotionState state;
  state.time = point.time;
  std::copy(point.angle.begin(), point.angle.end(), state.angle);
  std::copy(point.velocity.begin(), point.velocity.end(), state.velocity);
  std::copy(point.acceleration.begin(), point.acceleration.end(), state.acceleration);
  for (std::size_t i = 0; i < scene.inputs.size(); ++i) {
    CommandInputSettings input = scene.inputs[i];
    input.initial = point.input[i];
    state.signal[i].reset(input);
    state.last_command[i] = std::numeric_limits<double>::infinity();
  }
  return state;
}

std::string describeStability(const Scene& scene, const OperatingPoint& point) {
  try {
    const auto eigenvalues = calcEigenvalues(linearize(scene, point));
    double growth = 0.0;
    double fastest = 0.0;
    for (const std::complex<double>& value : eigenvalues) {
      growth = std::max(growth, value.real());
      fastest = std::max(fastest, std::abs(value));
    }
    if (growth <= 1e-7 * fastest) return "stable, integrators apart";
    return "unstable: deviations grow with " + formatNumber(growth) + " 1/s";
  } catch (const SceneError& error) {
    return std::string("no linear model: ") + error.what();
  }
}

}  // namespace variator_sim
