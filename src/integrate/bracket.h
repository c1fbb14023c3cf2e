/// Brackets around the root of a function over a step.
#pragma once

#include <algorithm>
#include <cmath>

#include "integrate/step_curve.h"

namespace variator_sim {

/// Closes a bracket around the root of a polynomial that falls through 0 once from 0 to 1, by
/// Newton's iteration, which goes a little beyond the root to close it from either side.
inline void narrowBracket(const StepCurve::Coefficients& gap, double resolution, double* low,
                          double* high) {
  constexpr int kIterations = 60;
  double at = gap.front() / (gap.front() - gap.back());
  for (int n = 0; n < kIterations && (*high - *low) > resolution; ++n) {
    double slope;
    const double value = StepCurve::valueAt(gap, at, &slope);
    (value > 0.0 ? *low : *high) = at;
    at += (value > 0.0 ? 0.25 : -0.25) * resolution - value / slope;
    if (!(at > *low && at < *high)) at = 0.5 * (*low + *high);
  }
}

/// Closes a bracket between two parts of a step at which f is not negative and negative, by
/// Chandrupatla's method (A new hybrid quadratic/bisection algorithm for finding the zero of a
/// nonlinear function without using derivatives, Adv. Eng. Softw. 28 (1997) 145): bisection where
/// the inverse parabola through the last three points does not fall between the ends.
template <class Gap>
void narrowBracket(const Gap& gap, double resolution, double f_low, double f_high, double* low,
                   double* high) {
  constexpr int kIterations = 80;
  double a = *high;
  double fa = f_high;
  double b = *low;
  double fb = f_low;
  double t = fa / (fa - fb);
  for (int n = 0; n < kIterations && (*high - *low) > resolution; ++n) {
    const double least = std::min(0.5, 0.5 * resolution / std::abs(b - a));
    const double x = a + std::clamp(t, least, 1.0 - least) * (b - a);
    if (!(x > *low && x < *high)) return;
    const double fx = gap(x);
    double c = a;
    double fc = fa;
    if ((fx < 0.0) != (fa < 0.0)) {
      c = b;
      fc = fb;
      b = a;
      fb = fa;
    }
    a = x;
    fa = fx;
    (fx < 0.0 ? *high : *low) = x;
    const double xi = (a - b) / (c - b);
    const double phi = (fa - fb) / (fc - fb);
    t = 0.5;
    if (phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi) {
      t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb);
    }
  }
}

}  // namespace variator_sim
