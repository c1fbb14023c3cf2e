/// What a scene's size and form fix at compile time.
///
/// One source serves every scene: `Shape<S>` leaves the number of constraints and the form of the
/// inertia to be looked up while running; a shape that names them lets the compiler unroll and drop
/// what is not there. make_motion.h says which shapes there are.
#pragma once

#include "variator_sim/inertia.h"
#include "variator_sim/principle.h"

namespace variator_sim {

/// `Rows`: number of constraints, or kAnyRows. `Simple`: the inertia is constant and diagonal.
template <int Shafts, int Rows = kAnyRows, bool Simple = false>
struct Shape {
  static constexpr int kShafts = Shafts;
  static constexpr int kRows = Rows;
  using InertiaType = Inertia<Shafts, Simple>;
};

}  // namespace variator_sim
