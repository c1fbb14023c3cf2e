/// How stiff a motion is, as the last terms of its series tell.
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/tolerance.h"
#include "variator_sim/types.h"

namespace variator_sim::series_stiffness {

/// The largest size of a component that has died away, in tolerances.
constexpr double kFaint = 100.0;
/// The part of the largest last terms above which a component limits the steps.
constexpr double kLimiting = 0.05;
constexpr double kE = 2.718281828459045;
/// The number of derivatives that show an exponential, and their allowed relative departure.
constexpr int kDerivatives = 7;
constexpr double kMatch = 0.02;

/// Returns |lambda| of the exponential, or of the pair of them, that the last derivatives
/// d_n = n! c_n are of: d_n = lambda d_{n-1}, or d_n = a d_{n-1} + b d_{n-2}. 0 where they are of
/// none: those of a singularity at a distance R grow as n! / R^n.
inline double exponentialRate(const double* c, int last) {
  double d[kDerivatives];  // the last first, over last!
  double factor = 1.0;     // (last - j)! / last!
  d[0] = c[last];
  for (int j = 1; j < kDerivatives; ++j) {
    factor /= last - j + 1;
    d[j] = c[last - j] * factor;
  }
  const double lambda = d[0] / d[1];
  const auto isSingle = [&](int j) {
    return std::abs(d[j] - lambda * d[j + 1]) <= kMatch * std::abs(d[j]);
  };
  if (isSingle(1) && isSingle(2) && isSingle(3) && isSingle(4)) {
    return std::abs(lambda);
  }
  const double det = d[1] * d[3] - d[2] * d[2];
  const double a = (d[0] * d[3] - d[1] * d[2]) / det;
  const double b = (d[1] * d[1] - d[0] * d[2]) / det;
  const auto isPair = [&](int j) {
    const double first = a * d[j + 1];
    const double second = b * d[j + 2];
    return std::abs(d[j] - first - second) <= kMatch * (std::abs(first) + std::abs(second));
  };
  if (!isPair(2) || !isPair(3) || !isPair(4)) return 0.0;
  const double square = 0.25 * a * a + b;
  return square < 0.0 ? std::sqrt(-b) : std::abs(0.5 * a) + std::sqrt(square);
}

/// Returns the largest of three coefficients: one of them may vanish by accident.
inline double largestOf(const double* c) {
  return std::max({std::abs(c[0]), std::abs(c[1]), std::abs(c[2])});
}

inline double power(double base, int exponent) {
  double result = 1.0;
  for (; exponent > 0; exponent >>= 1, base *= base) {
    if ((exponent & 1) != 0) result *= base;
  }
  return result;
}

/// The early term of a series of N terms that tells a component which has died away: it has at most
/// `bound` tolerances there, for x^m / m! at x = N / e, where it limits a step.
struct EarlyTerm {
  explicit EarlyTerm(int most) : index(std::max(2, most / 4)), bound(2.0 * kFaint) {
    for (int k = 1; k <= index; ++k) bound *= most / (kE * k);
  }
  int index;
  double bound;
};

/// Estimates |h lambda| over the bound of the scheme's stability, h = `length` units, from the
/// coefficients c of each component from `first` to `count`, of which `last` is the last one.
///
/// A component limits the steps and is itself of the tolerance's size where it has died away: it is
/// in the coefficients as delta lambda^n / n! and allows about |lambda h|^N / N! = 1. So does a
/// singularity of size delta at a distance R, which allows |h| < R. Of a motion that swings or
/// turns so fast delta is far above the tolerance.
///
/// A component that has died away has at most early.bound / length^early.index tolerances in its
/// early term.
inline double estimate(const double* const* rows, int first, int count, int last, double length,
                       const EarlyTerm& early, const Tolerance& tolerance) {
  double stiffest = 0.0;
  const double most_early = early.bound / power(length, early.index);
  double size[3 * kMaxShafts];  // of the last terms, but for the same factor in all
  double largest_size = 0.0;
  for (int n = first; n < count; ++n) {
    const double* const c = rows[n] + last;
    const double own = std::max(std::abs(c[0]) * length, std::abs(c[-1]));
    size[n] = own / tolerance.of(rows[n][0]);
    largest_size = std::max(largest_size, size[n]);
  }
  for (int n = first; n < count; ++n) {
    if (!(size[n] >= kLimiting * largest_size)) continue;
    const double* const c = rows[n];
    // A component that has died away has at most this in its early terms.
    if (std::abs(c[early.index]) > most_early * tolerance.of(c[0])) continue;
    const double faint = kFaint * tolerance.of(c[0]);
    const double rate = exponentialRate(c, last);  // |lambda| unit
    if (rate > 0.0) {
      const double largest = std::max(std::abs(c[last]), std::abs(c[last - 1]) * rate / last);
      double factorial = 1.0;
      for (int k = 2; k <= last; ++k) factorial *= k;
      const double delta = largest * (factorial / power(rate, last));
      if (delta <= faint) stiffest = std::max(stiffest, rate * length * kE / last);
    } else {
      const double here = largestOf(c + last - 2);
      const double radius = std::sqrt(std::sqrt(largestOf(c + last - 6) / here));
      if (here * power(radius, last - 1) <= faint) stiffest = std::max(stiffest, length / radius);
    }
  }
  return stiffest;
}

}  // namespace variator_sim::series_stiffness
