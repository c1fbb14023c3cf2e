/// The error of all benchmarks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace variator_sim::benchmark {

/// max over all components of |x - reference| / max(1, |reference|); NaN when x has one.
template <class X, class Reference>
double calcError(const X* x, const Reference* reference, std::size_t count) {
  long double largest = 0.0L;
  for (std::size_t i = 0; i < count; ++i) {
    const long double exact = reference[i];
    const long double error = std::abs(x[i] - exact) / std::max(1.0L, std::abs(exact));
    if (!(error >= 0.0L)) return std::numeric_limits<double>::quiet_NaN();
    largest = std::max(largest, error);
  }
  return static_cast<double>(largest);
}

}  // namespace variator_sim::benchmark
