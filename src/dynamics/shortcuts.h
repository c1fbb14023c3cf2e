/// What a scene does not need, and can be made to do all the same.
#pragma once

namespace variator_sim {

/// For tests and benchmarks, which turn off what they measure: the motion is the same without, but
/// for rounding.
struct Shortcuts {
  bool specialize = true;   ///< code made for two shafts and one constraint
  bool skip_angles = true;  ///< no derivatives by angles that nothing reads
  bool factor_once = true;  ///< one factorization where C and J are constant
};

}  // namespace variator_sim
