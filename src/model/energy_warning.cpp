#include "model/energy_warning.h"

#include <cmath>
#include <cstddef>
#include <limits>

#include "model/check_point.h"
#include "variator_sim/nearest_name.h"

namespace variator_sim {
namespace {

/// Tells whether the reactions of a constraint of order 1 have power under `gauss`: R = C^T lambda
/// has lambda C omega. For f homogeneous in omega of degree d this is lambda d f = 0 (Euler); else
/// C omega / f differs from state to state. A constraint that is not zero at rest imposes a motion
/// and is meant to have power.
bool takesEnergy(const Constraint& constraint, const Scene& scene) {
  constexpr double kRounding = 1e-9;
  Random random;
  double degree = std::numeric_limits<double>::quiet_NaN();
  for (int n = 0; n < 16; ++n) {
    const double speed = std::pow(10.0, n / 4);
    const CheckPoint point = scaled(shaken(scene, startOf(scene), 1.0, random), 1.0, speed);
    const double at_rest = constraint.calcResidual(scaled(point, 1.0, 0.0).view());
    const double f = constraint.calcResidual(point.view());
    ConstraintPartials partials;
    constraint.calcPartials(point.view(), partials);
    double power = 0.0;
    double size = 0.0;
    for (int i = 0; i < scene.shaftCount(); ++i) {
      const double part = partials.velocity[i] * point.velocity[static_cast<std::size_t>(i)];
      power += part;
      size += std::abs(part);
    }
    if (!std::isfinite(f) || !std::isfinite(size) || !std::isfinite(at_rest)) continue;
    if (std::abs(at_rest) > kRounding * size) return false;
    if (std::abs(f) < 1e-3 * size) continue;  // lost in rounding
    if (std::isnan(degree)) degree = power / f;
    if (std::abs(power / f - degree) > kRounding * (1.0 + size / std::abs(f))) return true;
  }
  return false;
}

}  // namespace

void warnOfEnergy(const Constraint& constraint, Scene* scene) {
  if (scene->principle != Principle::kGauss || constraint.order() != 1) return;
  if (!constraint.direction().empty() || !takesEnergy(constraint, *scene)) return;
  scene->warnings.push_back(
      "under the principle 'gauss' the reactions of the constraint " + inQuotes(constraint.name()) +
      " take or give energy (--energy shows how much): it is not proportional to the speeds, so "
      "C = df/dw is not in their ratio; for a ratio that follows a speed and loses nothing take "
      "variator_sim/KinematicRatio, whose 'reaction' is 'lossless' by default "
      "(doc/scene.md)");
}

}  // namespace variator_sim
