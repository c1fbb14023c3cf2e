/// The key `ratio` of elements that act through a gear.
#pragma once

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// `ratio`, default 1, any number but 0. Throws SceneError.
inline double readRatio(ParameterReader& parameters) {
  const double ratio = parameters.number("ratio", Range::any(), 1.0);
  if (ratio == 0.0) {
    throw SceneError(parameters.keyPath("ratio"), "0 is no ratio; allowed: any number but 0");
  }
  return ratio;
}

}  // namespace variator_sim
