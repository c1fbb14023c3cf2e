/// The error that is allowed.
#pragma once

#include <algorithm>
#include <cmath>

namespace variator_sim {

/// The allowed error of a component x: absolute + relative |x|.
struct Tolerance {
  double absolute;
  double relative;
  double of(double x) const { return absolute + relative * std::abs(x) + 1e-300; }
  double of(double x, double x_new) const { return of(std::max(std::abs(x), std::abs(x_new))); }
};

}  // namespace variator_sim
