#include "variator_sim/table.h"

#include <algorithm>
#include <boost/math/interpolators/quintic_hermite.hpp>
#include <cmath>
#include <string>
#include <utility>

namespace variator_sim {
namespace {

using Numbers = std::vector<double>;

/// The list at `key`: `size` numbers, or however many (but two at least) when `size` is 0.
Numbers readColumn(ParameterReader& reader, const Table::Column& column, std::size_t size) {
  const ParameterTree* list = reader.raw(column.key);
  if (list != nullptr && list->kind() == ParameterTree::Kind::kList && size == 0) {
    size = std::max<std::size_t>(2, list->asList().size());
  }
  return reader.numbers(column.key, std::max<std::size_t>(2, size), column.range);
}

/// Slopes s and second derivatives q at the points, as the header states them.
struct Derivatives {
  Numbers s;
  Numbers q;
};

/// Slope of a point between intervals of slopes d_l, d_r and widths h_l, h_r.
double limitedSlope(double d_l, double d_r, double h_l, double h_r) {
  if (!(d_l * d_r > 0.0)) return 0.0;
  const double steepest = 1.25 * std::min(std::abs(d_l), std::abs(d_r));
  // Weights first: no product of a slope and a width can overflow.
  const double s = d_l * (h_r / (h_l + h_r)) + d_r * (h_l / (h_l + h_r));
  return std::copysign(std::min(std::abs(s), steepest), d_l);
}

/// Limits q, which stands at the left end (side = 1) or at the right end (side = -1) of an interval
/// of slope d and width h, where the slope is s: with sigma the sign of d,
///     -4 sigma s / h  <=  side sigma q  <=  sigma (10 d - 8 s) / h.
/// A flat interval (d = 0, so s = 0) leaves q = 0.
double limitedCurvature(double q, double side, double s, double d, double h) {
  const double sign = d > 0.0 ? side : -side;
  const double lowest = -4.0 * std::abs(s) / h;
  const double highest = (10.0 * std::abs(d) - 8.0 * std::abs(s)) / h;
  return sign * std::min(highest, std::max(lowest, sign * q));
}

Derivatives calcDerivatives(const Numbers& x, const Numbers& y, Table::Beyond beyond) {
  const std::size_t n = x.size();
  Numbers h(n - 1);
  Numbers d(n - 1);
  for (std::size_t k = 0; k + 1 < n; ++k) {
    h[k] = x[k + 1] - x[k];
    d[k] = (y[k + 1] - y[k]) / h[k];
  }
  Derivatives at{Numbers(n, 0.0), Numbers(n, 0.0)};
  if (beyond == Table::Beyond::kLinear) {
    at.s.front() = d.front();
    at.s.back() = d.back();
  }
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double s = limitedSlope(d[k - 1], d[k], h[k - 1], h[k]);
    double q = 2.0 * (d[k] - d[k - 1]) / (h[k - 1] + h[k]);
    // Both intervals allow q = 0, so what the second limit leaves keeps the first one.
    q = limitedCurvature(q, -1.0, s, d[k - 1], h[k - 1]);
    q = limitedCurvature(q, 1.0, s, d[k], h[k]);
    at.s[k] = s;
    at.q[k] = q;
  }
  return at;
}

}  // namespace

struct Table::Curve : boost::math::interpolators::quintic_hermite<Numbers> {
  using quintic_hermite::quintic_hermite;
};

Table Table::read(ParameterReader& reader, const Column& x_column, const Column& y_column,
                  Beyond beyond) {
  reader.allow(x_column.key);
  reader.allow(y_column.key);
  Numbers x = readColumn(reader, x_column, 0);
  Numbers y = readColumn(reader, y_column, x.size());
  const auto element = [&](const Column& column, std::size_t k) {
    return reader.keyPath(column.key) + "[" + std::to_string(k) + "]";
  };
  const auto text = [](double value) { return ParameterTree::real(value).toText(); };
  for (std::size_t k = 1; k < x.size(); ++k) {
    if (x[k] > x[k - 1]) continue;
    throw SceneError(element(x_column, k), text(x[k]) + " does not lie above " + text(x[k - 1]) +
                                               " before it; allowed: numbers in strictly "
                                               "increasing order");
  }
  Derivatives at = calcDerivatives(x, y, beyond);
  for (std::size_t k = 0; k < x.size(); ++k) {
    const std::size_t before = k == 0 ? 0 : k - 1;
    const double h = x[k] - x[before];
    const double d = h > 0.0 ? (y[k] - y[before]) / h : 0.0;
    const double limit = 1e150;
    if (h < limit && std::abs(d) < limit && std::abs(at.q[k]) < limit) continue;
    throw SceneError(element(y_column, k), text(y[k]) + " at " + text(x[k]) +
                                               ": the table is too steep or too wide here; "
                                               "allowed: slopes and intervals below 1e150");
  }

  Table table;
  table.first_ = {x.front(), y.front(), at.s.front()};
  table.last_ = {x.back(), y.back(), at.s.back()};
  table.points_ = std::make_shared<const Numbers>(x);
  table.curve_ =
      std::make_shared<Curve>(std::move(x), std::move(y), std::move(at.s), std::move(at.q));
  return table;
}

// The curve throws outside of its points and is not to see NaN: only what lies strictly between its
// ends is passed on.

double Table::value(double x) const {
  if (x >= last_.x) return last_.y + last_.slope * (x - last_.x);
  if (x <= first_.x) return first_.y + first_.slope * (x - first_.x);
  return std::isnan(x) ? x : (*curve_)(x);
}

double Table::slope(double x) const {
  if (x >= last_.x) return last_.slope;
  if (x <= first_.x) return first_.slope;
  return std::isnan(x) ? x : curve_->prime(x);
}

double Table::curvature(double x) const {
  if (x >= last_.x || x <= first_.x) return 0.0;
  return std::isnan(x) ? x : curve_->double_prime(x);
}

}  // namespace variator_sim
