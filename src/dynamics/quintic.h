/// The zeros of a polynomial of degree 5.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace variator_sim {

/// Coefficients of a polynomial of degree 5 in Bernstein's form on an interval.
using Quintic = std::array<double, 6>;

/// Calls `found` with places in (low, high) where the polynomial changes its sign, from minus to
/// plus if it `rises`. An interval without a change of sign among the coefficients has no zero
/// (Descartes); de Casteljau's algorithm halves the others.
template <class Found>
void findZeros(const Quintic& whole, double low, double high, bool rises, Found found) {
  constexpr double kNarrow = 1.0 / (1 << 24);
  const auto isBelow = [](double value) { return value < 0.0; };
  const auto count = std::count_if(whole.begin(), whole.end(), isBelow);
  if (count == 0 || count == 6) return;
  const double middle = 0.5 * (low + high);
  if (high - low < kNarrow) {
    const bool is_zero = isBelow(whole[0]) != isBelow(whole[5]);
    if (is_zero && (isBelow(whole[0]) || !rises)) found(middle);
    return;
  }
  Quintic left;
  Quintic right = whole;
  for (std::size_t n = 0; n < 6; ++n) {
    left[n] = right[0];
    for (std::size_t m = 0; m + n < 5; ++m) right[m] = 0.5 * (right[m] + right[m + 1]);
  }
  findZeros(left, low, middle, rises, found);
  findZeros(right, middle, high, rises, found);
}

}  // namespace variator_sim
