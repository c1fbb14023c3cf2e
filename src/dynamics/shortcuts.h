/// Evaluations that a scene can skip.
#pragma once

namespace variator_sim {

/// The motion is the same without them, except for rounding.
struct Shortcuts {
  bool specialize = true;   ///< code made for two shafts and one constraint
  bool skip_angles = true;  ///< no derivatives by angles that no law reads
  bool has_series = true;   ///< false: no series of the formulas, which only steps need
};

}  // namespace variator_sim
