/// The motion for a scene's principle and orders.
#pragma once

#include <algorithm>
#include <memory>
#include <utility>

#include "classical_gauss.h"
#include "generalized_gauss.h"
#include "motion_of.h"

namespace variator_sim {

/// True when the inertia of `scene` is constant and diagonal.
inline bool hasSimpleInertia(const Scene& scene) {
  return std::all_of(scene.inertia_harmonics.begin(), scene.inertia_harmonics.end(),
                     [](const auto& shaft) { return shaft.empty(); }) &&
         scene.inertia.isDiagonal(0.0);
}

/// The motion of a scene of S shafts. One shape serves every scene of that size; the most frequent
/// scene, two shafts and one constraint, has a shape that knows it.
template <int S>
std::unique_ptr<Motion> makeMotion(Scene scene) {
  if (scene.principle == Principle::kGeneralizedGauss) {
    if constexpr (S == 2) {
      if (scene.constraintCount() == 1 && hasSimpleInertia(scene) && scene.solver.specialize) {
        return std::make_unique<MotionOf<GeneralizedGauss<Shape<2, 1, true>>>>(std::move(scene));
      }
    }
    return std::make_unique<MotionOf<GeneralizedGauss<Shape<S>>>>(std::move(scene));
  }
  if (scene.hasOrder3()) return std::make_unique<MotionOf<FormalGauss<Shape<S>>>>(std::move(scene));
  return std::make_unique<MotionOf<ClassicalGauss<Shape<S>>>>(std::move(scene));
}

}  // namespace variator_sim
