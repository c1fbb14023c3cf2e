/// Smooth stand-ins for functions with a corner or a jump, each with its derivatives. [loop]
#pragma once

#include <cmath>

namespace variator_sim {

/// A function's value and its first two derivatives.
struct SmoothValue {
  double value;
  double slope;
  double curvature;
};

/// The sign of x with the width 1: tanh x.
inline SmoothValue smoothSign(double x) {
  const double value = std::tanh(x);
  // 1/cosh^2 x; 1 - tanh^2 x would lose all its digits where tanh is nearly 1.
  const double tail = std::exp(-2.0 * std::abs(x));
  const double slope = 4.0 * tail / ((1.0 + tail) * (1.0 + tail));
  return {value, slope, -2.0 * value * slope};
}

/// From 0 (x <= 0) to 1 (x >= 1), two times continuously differentiable:
///     S(x) = 10 x^3 - 15 x^4 + 6 x^5,   S'(x) = 30 x^2 (1 - x)^2,
///     S''(x) = 60 x (1 - x) (1 - 2 x).
inline SmoothValue smoothStep(double x) {
  if (x <= 0.0) return {0.0, 0.0, 0.0};
  if (x >= 1.0) return {1.0, 0.0, 0.0};
  return {x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) * (1.0 - x),
          60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)};
}

/// The magnitude of x, smooth within about x0 of zero and exact for x0 = 0:
///     a(x) = x^2 / h,   a'(x) = r (2 - r^2),   a''(x) = (2 - 3 r^2) (1 - r^2) / h,
///     h = sqrt(x^2 + x0^2), r = x / h.
inline SmoothValue smoothMagnitude(double x, double x0) {
  const double h = std::hypot(x, x0);
  if (h == 0.0) return {0.0, 0.0, 0.0};
  const double r = x / h;
  return {x * r, r * (2.0 - r * r), (2.0 - 3.0 * r * r) * (1.0 - r) * (1.0 + r) / h};
}

}  // namespace variator_sim
