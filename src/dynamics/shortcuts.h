/// Evaluations that a scene can skip.
#pragma once

namespace variator_sim {

/// Switches for tests and benchmarks: the motion is the same without the shortcuts, except for
/// rounding.
struct Shortcuts {
  bool specialize = true;   ///< code made for two shafts and one constraint
  bool skip_angles = true;  ///< no derivatives by angles that no law reads
};

}  // namespace variator_sim
