/// Smooth stand-ins for functions with a corner or a jump, each with its derivative. [loop]
#pragma once

#include <cmath>

namespace variator_sim {

/// A function's value and its derivative.
struct ValueAndSlope {
  double value;
  double slope;
};

/// The sign of x with the width 1: tanh x.
inline ValueAndSlope smoothSign(double x) {
  const double value = std::tanh(x);
  return {value, (1.0 - value) * (1.0 + value)};
}

/// From 0 (x <= 0) to 1 (x >= 1), two times continuously differentiable:
///     S(x) = 10 x^3 - 15 x^4 + 6 x^5,   S'(x) = 30 x^2 (1 - x)^2.
inline ValueAndSlope smoothStep(double x) {
  if (x <= 0.0) return {0.0, 0.0};
  if (x >= 1.0) return {1.0, 0.0};
  return {x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) * (1.0 - x)};
}

/// The magnitude of x, smooth within about x0 of zero and exact for x0 = 0:
///     a(x) = x^2 / h,   a'(x) = r (2 - r^2),   h = sqrt(x^2 + x0^2), r = x / h.
inline ValueAndSlope smoothMagnitude(double x, double x0) {
  const double h = std::hypot(x, x0);
  if (h == 0.0) return {0.0, 0.0};
  const double r = x / h;
  return {x * r, r * (2.0 - r * r)};
}

}  // namespace variator_sim
