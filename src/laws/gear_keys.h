/// Keys that elements share which act through a gear, or hold.
#pragma once

#include "variator_sim/law_context.h"

namespace variator_sim {

/// Reads `ratio`, default 1, any number but 0. Throws SceneError.
inline Expression readRatio(LawContext& scene) {
  const Expression ratio = scene.quantity("ratio", Range::any("1"), 1.0);
  if (ratio.isConstant() && ratio.value() == 0.0) {
    throw scene.parameters().error("ratio", "0 is no ratio; allowed: any number but 0");
  }
  return ratio;
}

/// Reads `shafts` [a, b] and `ratio` i (default 1): i omega_b - omega_a; or `shaft`: omega.
inline Expression readSlip(LawContext& scene) {
  if (!scene.parameters().has("shafts")) {
    scene.keys({"shaft"});
    return scene.shaft("shaft").velocity;
  }
  scene.keys({"shafts", "ratio"});
  const std::vector<Shaft> shafts = scene.shafts("shafts", 2);
  return readRatio(scene) * shafts[1].velocity - shafts[0].velocity;
}

/// Reads `initial`: `auto`, or `stuck` or `slipping`, which the first state then has to be.
inline Holding::Begin readBegin(LawContext& scene) {
  using Begin = Holding::Begin;
  return scene.parameters().choice<Begin>(
      "initial", {{"auto", Begin::kAuto}, {"stuck", Begin::kStuck}, {"slipping", Begin::kSlipping}},
      "auto");
}

}  // namespace variator_sim
