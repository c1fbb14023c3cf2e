/// The error that is allowed, and error norms in its units.
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/state_vector.h"

namespace variator_sim {

/// The allowed error of a component x: absolute + relative |x|.
struct Tolerance {
  double absolute;
  double relative;
  double of(double x) const { return absolute + relative * std::abs(x) + 1e-300; }
  double of(double x, double x_new) const { return of(std::max(std::abs(x), std::abs(x_new))); }
};

/// Largest |error_i| over its allowance at the larger of |x_i| and |x_new_i|; NaN when any error or
/// value is NaN. A step is good at most 1. (Boost.Odeint's own check drops NaN in max().)
inline double calcErrorNorm(const State& error, const State& x, const State& x_new,
                            const Tolerance& tolerance) {
  double norm = 0.0;
  double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
  for (int i = 0; i < error.size(); ++i) {
    norm = std::max(norm, std::abs(error[i]) / tolerance.of(x[i], x_new[i]));
    poison += 0.0 * (x_new[i] + error[i]);
  }
  return norm + poison;
}

/// The larger of two error norms; NaN when either is (std::max may drop it).
inline double worseOf(double a, double b) {
  return a >= b ? a : (b >= a ? b : a + b);
}

}  // namespace variator_sim
