#include "variator_sim/table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/table_axis.h"

namespace variator_sim {
namespace {

using Numbers = std::vector<double>;

/// Slopes s and second derivatives q at the points, as the header states them.
struct Derivatives {
  Numbers s;
  Numbers q;
};

/// Returns the slope of a point between intervals of slopes d_l, d_r and widths h_l, h_r.
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
    // Both intervals allow q = 0, so the second limit does not violate the first one.
    q = limitedCurvature(q, -1.0, s, d[k - 1], h[k - 1]);
    q = limitedCurvature(q, 1.0, s, d[k], h[k]);
    at.s[k] = s;
    at.q[k] = q;
  }
  return at;
}

}  // namespace

Numbers readColumn(ParameterReader& reader, const Table::Column& column, std::size_t size) {
  if (size == 0) {
    constexpr const char* kWanted = "a list of at least 2 numbers";
    const ParameterTree& list = reader.require(column.key, kWanted);
    const bool is_list = list.kind() == ParameterTree::Kind::kList;
    size = list.asList().size();
    if (size < 2) {
      throw reader.error(column.key, std::string("expected ") + kWanted + ", got " +
                                         (is_list ? std::to_string(size) : list.describeKind()) +
                                         ": " + list.toText());
    }
  }
  Numbers read = reader.numbers(column.key, size, column.range);
  for (double& number : read) number = column.unit.toSi(number);
  return read;
}

void checkIncreasing(const Numbers& x, const char* column, const Table::Points::Fault& fault) {
  for (std::size_t k = 1; k < x.size(); ++k) {
    if (x[k] > x[k - 1]) continue;
    throw fault(column, k,
                formatReal(x[k]) + " does not lie above " + formatReal(x[k - 1]) +
                    " before it; allowed: numbers in strictly increasing order");
  }
}

struct Table::Curve {
  TableAxis axis;
  std::vector<TableCell> cells;
  Interpolation interpolation;
};

Table Table::read(ParameterReader& reader, const Column& x, const Column& y, const Shape& shape) {
  reader.allow(x.key);
  reader.allow(y.key);
  Points points;
  points.x = readColumn(reader, x);
  points.values = readColumn(reader, y, points.x.size());
  points.fault = [&](const char* column, std::size_t index, const std::string& message) {
    const char* const key = column[0] == 'x' ? x.key : y.key;
    return SceneError(elementPath(reader.keyPath(key), index), message);
  };
  return make(std::move(points), shape, reader.path());
}

Table Table::make(Points points, const Shape& shape, const std::string& origin) {
  const Numbers& x = points.x;
  const Numbers& y = points.values;
  checkIncreasing(x, "x", points.fault);
  const Derivatives at = calcDerivatives(x, y, shape.beyond);
  for (std::size_t k = 0; k < x.size(); ++k) {
    const std::size_t before = k == 0 ? 0 : k - 1;
    const double h = x[k] - x[before];
    const double d = h > 0.0 ? (y[k] - y[before]) / h : 0.0;
    const double limit = 1e150;
    if (h < limit && std::abs(d) < limit && std::abs(at.q[k]) < limit) continue;
    const auto point = [&](std::size_t n) { return formatReal(y[n]) + " at " + formatReal(x[n]); };
    throw points.fault(
        "values", k,
        point(k) + (k > 0 ? ", after " + point(k - 1) : "") +
            (k + 1 < x.size() ? ", before " + point(k + 1) : "") +
            ": the table is too steep or too wide here; allowed: slopes and intervals below 1e150");
  }
  Table table = through(std::move(points.x), y, shape);
  table.origin_ = origin;
  return table;
}

Table Table::through(Numbers x, const Numbers& y, const Shape& shape) {
  const bool is_smooth = shape.interpolation == Interpolation::kSmooth;
  const bool is_line = shape.interpolation == Interpolation::kLinear;
  const Derivatives at = calcDerivatives(x, y, shape.beyond);
  const std::size_t n = x.size();
  std::vector<TableCell> cells(n + 1);
  cells[0] = {y.front(), at.s.front()};
  for (std::size_t k = 1; k < n; ++k) {
    if (is_smooth) {
      cells[k] = hermiteCell(x[k] - x[k - 1], {y[k - 1], y[k]}, {at.s[k - 1], at.s[k]},
                             {at.q[k - 1], at.q[k]});
    } else {
      cells[k] = {y[k - 1], is_line ? y[k] - y[k - 1] : 0.0};
    }
  }
  cells[n] = {y.back(), at.s.back()};
  Table table;
  table.curve_ = std::make_shared<const Curve>(
      Curve{TableAxis(std::move(x), shape.beyond == Beyond::kConstant), std::move(cells),
            shape.interpolation});
  return table;
}

double Table::derivative(int order, double x) const {
  if (!curve_ || order > kTableDegree) return std::isnan(x) ? x : 0.0;
  // A smooth step is constant nearly all the time.
  const TableAxis& axis = curve_->axis;
  const bool is_below = x < axis.points().front();
  if (axis.isFlatBeyond() && (is_below || x >= axis.points().back())) {
    return order > 0 ? 0.0 : (is_below ? curve_->cells.front() : curve_->cells.back())[0];
  }
  const TableAxis::Place at = axis.find(x);
  double value = evaluateCell(curve_->cells[at.cell], at.t, order);
  for (int k = 0; k < order; ++k) value *= at.scale;
  return value;
}

std::vector<double> Table::points() const {
  return curve_ ? curve_->axis.points() : std::vector<double>{};
}

int smoothnessOf(Interpolation interpolation) {
  return interpolation == Interpolation::kSmooth   ? 3
         : interpolation == Interpolation::kLinear ? 1
                                                   : 0;
}

int Table::smoothness() const {
  return curve_ ? smoothnessOf(curve_->interpolation) : 3;
}

int Table::degree() const {
  return smoothness() == 3 ? kDegree : smoothness();
}

bool Table::isBounded() const {
  return !curve_ || curve_->axis.isFlatBeyond();
}

}  // namespace variator_sim
