/// Loops over shafts that the compiler can unroll.
#pragma once

#include <type_traits>

namespace variator_sim {

/// Returns body(count), with a small number of shafts as a constant of its own type, and as an int
/// else. For small functions called at every step.
template <class Body>
inline auto withShaftCount(int shafts, const Body& body) {
  switch (shafts) {
    case 2:
      return body(std::integral_constant<int, 2>{});
    case 3:
      return body(std::integral_constant<int, 3>{});
    case 4:
      return body(std::integral_constant<int, 4>{});
    default:
      return body(shafts);
  }
}

/// Calls body(n) for n from `first` to `last` - 1; the frequent numbers of components are unrolled.
template <class Body>
inline void forEachComponent(int first, int last, const Body& body) {
  const auto run = [&](auto count) {
    for (int n = 0; n < count; ++n) body(first + n);
  };
  switch (last - first) {
    case 2:
      return run(std::integral_constant<int, 2>{});
    case 4:  // two shafts: velocities and accelerations
      return run(std::integral_constant<int, 4>{});
    case 6:  // the same with angles, or three shafts
      return run(std::integral_constant<int, 6>{});
    default:
      return run(last - first);
  }
}

}  // namespace variator_sim
