/// Central differences by the state, the fallback for plugins without derivatives of their own.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "variator_sim/types.h"

namespace variator_sim {

/// Returns the shift of value i of `values` (`count` of them) to each side: a fraction of itself,
/// or of `natural_size` if that is larger, or, at zero, of the largest among them. Angles shift by
/// at most that fraction of 1: laws know them by their sine and cosine. [loop]
inline double calcShift(const double* values, int count, int i, bool are_angles,
                        double natural_size) {
  double size = std::max(natural_size, std::abs(values[i]));
  if (size == 0.0) {
    for (int j = 0; j < count; ++j) size = std::max(size, std::abs(values[j]));
  }
  if (size == 0.0 || (are_angles && size > 1.0)) size = 1.0;
  return std::cbrt(std::numeric_limits<double>::epsilon()) * size;
}

/// Calls use(q, above, below, width) for each of the 3s directions of (phi, omega, epsilon), with
/// views shifted by half the width to both sides, see calcShift. [loop]
template <class Use>
void forEachShift(const StateView& state, int shaft_count, Use use, double natural_size = 1.0) {
  double above[kMaxShafts];
  double below[kMaxShafts];
  for (int part = 0; part < 3; ++part) {
    const double* StateView::*member = part == 0   ? &StateView::angle
                                       : part == 1 ? &StateView::velocity
                                                   : &StateView::acceleration;
    const double* values = state.*member;
    std::copy_n(values, shaft_count, above);
    std::copy_n(values, shaft_count, below);
    StateView view_above = state;
    StateView view_below = state;
    view_above.*member = above;
    view_below.*member = below;
    for (int i = 0; i < shaft_count; ++i) {
      const double step = calcShift(values, shaft_count, i, part == 0, natural_size);
      above[i] = values[i] + step;
      below[i] = values[i] - step;
      use(part * shaft_count + i, view_above, view_below, above[i] - below[i]);
      above[i] = below[i] = values[i];
    }
  }
}

}  // namespace variator_sim
