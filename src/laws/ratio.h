/// The key `ratio` of elements that act through a gear.
#pragma once

#include "variator_sim/law_context.h"

namespace variator_sim {

/// Reads `ratio`, default 1, any number but 0. Throws SceneError.
inline Expression readRatio(LawContext& scene) {
  const Expression ratio = scene.quantity("ratio", Range::any("1"), 1.0);
  if (ratio.isConstant() && ratio.value() == 0.0) {
    throw SceneError(scene.parameters().keyPath("ratio"),
                     "0 is no ratio; allowed: any number but 0");
  }
  return ratio;
}

}  // namespace variator_sim
