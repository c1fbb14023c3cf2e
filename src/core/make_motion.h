/// The motion for a scene's principle and orders.
#pragma once

#include <algorithm>
#include <memory>
#include <utility>

#include "classical_gauss.h"
#include "generalized_gauss.h"
#include "motion_of.h"

namespace variator_sim {

/// The motion of a scene of S shafts.
template <int S>
std::unique_ptr<Motion> makeMotion(Scene scene) {
  if (scene.principle == Principle::kGeneralizedGauss) {
    return std::make_unique<MotionOf<GeneralizedGauss<S>>>(std::move(scene));
  }
  const bool has_order3 =
      std::any_of(scene.constraints.begin(), scene.constraints.end(),
                  [](const ConstraintPtr& constraint) { return constraint->order() == 3; });
  if (has_order3) return std::make_unique<MotionOf<FormalGauss<S>>>(std::move(scene));
  return std::make_unique<MotionOf<ClassicalGauss<S>>>(std::move(scene));
}

}  // namespace variator_sim
