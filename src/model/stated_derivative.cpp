#include "model/stated_derivative.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace variator_sim {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

struct Difference {
  double central;
  double margin;  ///< of rounding in the values
  double kink;    ///< right-hand less left-hand derivative
};

/// Differences around 0 with the step h, `here` being the value there; nothing where some value is
/// not finite.
std::optional<Difference> calcDifference(const std::function<double(double)>& function, double here,
                                         double h) {
  const std::array<double, 4> f{function(-2.0 * h), function(-h), function(h), function(2.0 * h)};
  // Numbers below the least normal one are rounded as it is.
  double largest = std::max(std::abs(here), std::numeric_limits<double>::min());
  for (const double value : f) largest = std::max(largest, std::abs(value));
  if (!std::isfinite(largest)) return std::nullopt;
  Difference d{};
  d.central = (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h);
  d.margin = 8.0 * kEpsilon * largest / h;
  // one-sided differences of order 2
  const double right = (-3.0 * here + 4.0 * f[2] - f[3]) / (2.0 * h);
  const double left = (3.0 * here - 4.0 * f[1] + f[0]) / (2.0 * h);
  d.kink = right - left;
  return d;
}

}  // namespace

std::optional<double> findDisagreement(const std::function<double(double)>& function, double stated,
                                       double scale, double slack) {
  const double here = function(0.0);
  if (!std::isfinite(stated) || !std::isfinite(here)) return std::nullopt;
  constexpr int kSteps = 12;
  constexpr double kTolerance = 1e-5;
  std::vector<Difference> differences;
  double h = 0.02 * scale;
  for (int n = 0; n < kSteps; ++n, h *= 0.25) {
    const std::optional<Difference> d = calcDifference(function, here, h);
    if (!d) continue;
    const double size = std::max(std::abs(stated), std::abs(d->central));
    if (std::abs(d->central - stated) <= kTolerance * size + slack) return std::nullopt;
    differences.push_back(*d);
  }
  // The two consecutive steps that agree best.
  double best = std::numeric_limits<double>::infinity();
  std::size_t at = 0;
  for (std::size_t n = 0; n + 1 < differences.size(); ++n) {
    const double doubt = std::abs(differences[n].central - differences[n + 1].central) +
                         differences[n].margin + differences[n + 1].margin;
    if (doubt < best) {
      best = doubt;
      at = n + 1;
    }
  }
  if (!std::isfinite(best)) return std::nullopt;
  const double value = differences[at].central;
  const double gap = std::abs(value - stated);
  const double size = std::max(std::abs(stated), std::abs(value));
  if (gap <= kTolerance * size + slack + 100.0 * best) return std::nullopt;
  // Differences across something much narrower than the steps do not settle.
  if (best > 1e-3 * std::abs(value) && best > 1e-9 * std::abs(stated)) return std::nullopt;
  // A kink here or within reach of every step: the sides do not tend to each other.
  double sides = std::numeric_limits<double>::infinity();
  for (const Difference& d : differences) sides = std::min(sides, std::abs(d.kink) + d.margin);
  if (sides > 0.1 * gap) return std::nullopt;
  return value;
}

}  // namespace variator_sim
