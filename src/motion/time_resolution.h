/// How finely a double tells a time.
#pragma once

#include <cmath>
#include <limits>

namespace variator_sim {

/// Differences from `time` that are no more than this no longer change it reliably. [loop]
inline double resolutionOf(double time) {
  return 4.0 * std::numeric_limits<double>::epsilon() * std::abs(time);
}

}  // namespace variator_sim
