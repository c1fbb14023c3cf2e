#include "variator_sim/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace variator_sim {

/// Polynomials of degree five in a cell's coordinate.
using TableCell = std::array<double, Table::kDegree + 1>;

/// The real numbers in n + 1 cells around n points: cell 0 below the first, cell k between points
/// k - 1 and k (the lower one included), cell n from the last one on.
class TableAxis {
 public:
  TableAxis() = default;
  /// `is_flat_beyond`: the table is constant in cells 0 and n.
  TableAxis(std::vector<double> points, bool is_flat_beyond)
      : points_(std::move(points)), is_flat_beyond_(is_flat_beyond) {
    for (std::size_t cell = 1; cell < points_.size(); ++cell) scales_.push_back(1.0 / width(cell));
  }

  /// A number in its cell. In a cell between two points the coordinate t goes from 0 to 1; beyond
  /// the ends it is the signed distance from the end. t is NaN for an x that is NaN.
  struct Place {
    std::size_t cell;
    double t;
    double scale;  ///< dt/dx
  };

  Place find(double x) const {
    const std::size_t n = points_.size();
    const auto above = std::upper_bound(points_.begin(), points_.end(), x);
    const auto cell = static_cast<std::size_t>(above - points_.begin());
    if (cell > 0 && cell < n) return {cell, (x - low(cell)) * scale(cell), scale(cell)};
    const double from = cell == 0 ? points_.front() : points_.back();
    return {cell, is_flat_beyond_ && !std::isnan(x) ? 0.0 : x - from, 1.0};
  }

  const std::vector<double>& points() const { return points_; }
  std::size_t cellCount() const { return points_.size() + 1; }
  bool isFlatBeyond() const { return is_flat_beyond_; }
  /// Return the lower end, width and 1/width of the inner cells 1 to n - 1.
  double low(std::size_t cell) const { return points_[cell - 1]; }
  double width(std::size_t cell) const { return points_[cell] - points_[cell - 1]; }
  double scale(std::size_t cell) const { return scales_[cell - 1]; }

 private:
  std::vector<double> points_;
  std::vector<double> scales_;  ///< 1/width, divided once
  bool is_flat_beyond_ = true;
};

namespace {

using Numbers = std::vector<double>;
/// Slopes s and second derivatives q at the points, as table.h states them.
struct TableDerivatives {
  std::vector<double> s;
  std::vector<double> q;
};
constexpr std::size_t kCoefficients = Table::kDegree + 1;

/// Limits the slope s of a point between intervals of slopes d_l and d_r.
double limitedSlope(double s, double d_l, double d_r) {
  if (!(d_l * d_r > 0.0)) return 0.0;
  const double steepest = 1.25 * std::min(std::abs(d_l), std::abs(d_r));
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

/// `is_limited`: as of a table of one variable.
TableDerivatives calcDerivatives(const TableAxis& axis, const Numbers& y, bool is_limited) {
  const std::size_t n = y.size();
  const auto h = [&](std::size_t k) { return axis.width(k + 1); };
  const auto d = [&](std::size_t k) { return (y[k + 1] - y[k]) / h(k); };
  TableDerivatives at{Numbers(n, 0.0), Numbers(n, 0.0)};
  if (!axis.isFlatBeyond()) {
    at.s.front() = d(0);
    at.s.back() = d(n - 2);
  }
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double d_l = d(k - 1);
    const double d_r = d(k);
    const double h_l = h(k - 1);
    const double h_r = h(k);
    // Weights first: no product of a slope and a width can overflow.
    double s = d_l * (h_r / (h_l + h_r)) + d_r * (h_l / (h_l + h_r));
    double q = 2.0 * (d_r - d_l) / (h_l + h_r);
    if (is_limited) {
      s = limitedSlope(s, d_l, d_r);
      // Both intervals allow q = 0, so the second limit does not violate the first one.
      q = limitedCurvature(q, -1.0, s, d_l, h_l);
      q = limitedCurvature(q, 1.0, s, d_r, h_r);
    }
    at.s[k] = s;
    at.q[k] = q;
  }
  return at;
}

/// Returns the polynomial with the values y, slopes s and second derivatives q at the ends of a
/// cell of width h.
TableCell hermiteCell(double h, const double (&y)[2], const double (&s)[2], const double (&q)[2]) {
  const double rise = y[1] - y[0];
  const double s0 = h * s[0];
  const double s1 = h * s[1];
  const double q0 = h * h * q[0];
  const double q1 = h * h * q[1];
  return {y[0],
          s0,
          0.5 * q0,
          10.0 * rise - 6.0 * s0 - 4.0 * s1 - 1.5 * q0 + 0.5 * q1,
          -15.0 * rise + 8.0 * s0 + 7.0 * s1 + 1.5 * q0 - q1,
          6.0 * rise - 3.0 * (s0 + s1) - 0.5 * (q0 - q1)};
}

TableCell makeCell(const TableAxis& axis, const Numbers& y, const TableDerivatives& at,
                   std::size_t k, Interpolation interpolation) {
  if (k == 0) return {y.front(), at.s.front()};
  if (k == y.size()) return {y.back(), at.s.back()};
  if (interpolation == Interpolation::kSmooth) {
    return hermiteCell(axis.width(k), {y[k - 1], y[k]}, {at.s[k - 1], at.s[k]},
                       {at.q[k - 1], at.q[k]});
  }
  return {y[k - 1], interpolation == Interpolation::kLinear ? y[k] - y[k - 1] : 0.0};
}

/// Returns the polynomials of a table of one variable.
std::vector<TableCell> makeCells(const TableAxis& axis, const Numbers& y,
                                 Interpolation interpolation) {
  const TableDerivatives at = calcDerivatives(axis, y, true);
  std::vector<TableCell> cells;
  for (std::size_t k = 0; k <= y.size(); ++k) {
    cells.push_back(makeCell(axis, y, at, k, interpolation));
  }
  return cells;
}

/// The polynomial of a cell as a function of the data: the coefficient of t^m is the sum of
/// weight[k][m] times the datum of point first + k. A cell depends on the two points at its ends
/// and one more on either side.
struct Stencil {
  int first = 0;
  std::array<TableCell, 4> weight{};
};

/// Returns one stencil for each cell of an axis: the cells where all data are 0 but one.
std::vector<Stencil> makeStencils(const TableAxis& axis, Interpolation interpolation) {
  std::vector<Stencil> stencils(axis.cellCount());
  for (std::size_t cell = 0; cell < stencils.size(); ++cell) {
    stencils[cell].first = static_cast<int>(cell) - 2;
  }
  Numbers y(axis.points().size(), 0.0);
  for (std::size_t datum = 0; datum < y.size(); ++datum) {
    y[datum] = 1.0;
    const TableDerivatives at = calcDerivatives(axis, y, false);
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t cell = datum + 2 - k;
      if (cell < stencils.size()) {
        stencils[cell].weight[k] = makeCell(axis, y, at, cell, interpolation);
      }
    }
    y[datum] = 0.0;
  }
  return stencils;
}

/// Adds the patch of two stencils over the data z, rows by x of `columns` numbers.
void addPatch(const Stencil& along_x, const Stencil& along_y, const Numbers& z, int columns,
              std::vector<TableCell>* cells) {
  std::array<TableCell, kCoefficients> patch{};
  const int rows = static_cast<int>(z.size()) / columns;
  for (std::size_t k = 0; k < 4; ++k) {
    const int row = along_x.first + static_cast<int>(k);
    if (row < 0 || row >= rows) continue;
    TableCell of_row{};
    for (std::size_t l = 0; l < 4; ++l) {
      const int column = along_y.first + static_cast<int>(l);
      if (column < 0 || column >= columns) continue;
      const int place = row * columns + column;
      const double datum = z[static_cast<std::size_t>(place)];
      for (std::size_t n = 0; n < kCoefficients; ++n) of_row[n] += along_y.weight[l][n] * datum;
    }
    for (std::size_t m = 0; m < kCoefficients; ++m) {
      for (std::size_t n = 0; n < kCoefficients; ++n) {
        patch[m][n] += along_x.weight[k][m] * of_row[n];
      }
    }
  }
  cells->insert(cells->end(), patch.begin(), patch.end());
}

/// Returns those of one of two variables, with the values z row by row, in t: of a cell of both
/// axes kCoefficients polynomials in u, the coefficients of t^m.
std::vector<TableCell> makePatches(const TableAxis& x, const TableAxis& y, const Numbers& z,
                                   Interpolation interpolation) {
  const std::vector<Stencil> along_x = makeStencils(x, interpolation);
  const std::vector<Stencil> along_y = makeStencils(y, interpolation);
  const int columns = static_cast<int>(y.points().size());
  std::vector<TableCell> cells;
  cells.reserve(along_x.size() * along_y.size() * kCoefficients);
  for (const Stencil& row : along_x) {
    for (const Stencil& column : along_y) addPatch(row, column, z, columns, &cells);
  }
  return cells;
}

/// Returns n!/(n - order)!.
double fallingFactorial(int n, int order) {
  double product = 1.0;
  for (int k = 0; k < order; ++k) product *= n - k;
  return product;
}

/// Returns d^order/dt^order of a polynomial at t.
double evaluateCell(const TableCell& c, double t, int order) {
  double sum = 0.0 * t;
  for (int n = Table::kDegree; n >= order; --n) {
    sum = sum * t + fallingFactorial(n, order) * c[static_cast<std::size_t>(n)];
  }
  return sum;
}

/// Reads a list in SI units: `size` numbers, or any number from two on when it is 0.
Numbers readColumn(ParameterReader& reader, const Table::Column& column, std::size_t size = 0) {
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

/// The products of the intervals of both axes are numbers, too.
void checkIntervals(const Numbers& x, const char* column, const Table::Points::Fault& fault) {
  for (std::size_t k = 1; k < x.size(); ++k) {
    if (x[k] - x[k - 1] < 1e100 && x[k] - x[k - 1] > 1e-100) continue;
    throw fault(column, k,
                formatNumber(x[k]) + " behind " + formatNumber(x[k - 1]) +
                    "; allowed: intervals from 1e-100 to 1e100");
  }
}

/// Reads the values of a grid, row by row.
Numbers readRows(ParameterReader& reader, const Table::Column& x, const Table::Column& y,
                 const Table::Column& z, std::size_t rows, std::size_t columns) {
  const std::string path = reader.keyPath(z.key);
  const ParameterTree* list = reader.raw(z.key);
  const std::string expected = "a list of " + std::to_string(rows) + " rows, one for each of " +
                               x.key + ", of " + std::to_string(columns) +
                               " numbers, one for each of " + y.key;
  if (list == nullptr) throw SceneError(path, "missing; expected " + expected);
  const auto size_of = [](const ParameterTree& value) {
    return value.kind() == ParameterTree::Kind::kList ? value.asList().size() : 0;
  };
  if (size_of(*list) != rows) {
    throw SceneError(path, list->kind() == ParameterTree::Kind::kList
                               ? std::to_string(size_of(*list)) + " rows; expected " + expected
                               : list->toText() + "; expected " + expected);
  }
  Numbers values;
  for (std::size_t i = 0; i < rows; ++i) {
    const std::string row_path = elementPath(path, i);
    const ParameterTree& row = list->asList()[i];
    if (size_of(row) != columns) {
      throw SceneError(row_path, row.toText() + "; expected " + expected);
    }
    for (std::size_t j = 0; j < columns; ++j) {
      values.push_back(z.unit.toSi(ParameterReader::toNumber(
          row.asList()[j], elementPath(row_path, j), Range::between(-1e100, 1e100))));
    }
  }
  return values;
}

void checkSteepness(const Table::Points& points, const TableAxis& axis) {
  const Numbers& x = points.x;
  const Numbers& y = points.values;
  const TableDerivatives at = calcDerivatives(axis, y, true);
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
}

}  // namespace

/// The polynomials of a table: one for each cell of one variable, kDegree + 1 of y for each cell of
/// two, row by row.
struct Table::Cells {
  TableAxis x;
  std::optional<TableAxis> y;
  std::vector<TableCell> polynomials;
  Interpolation interpolation;
};

Table Table::read(ParameterReader& reader, const std::vector<Column>& columns, const Shape& shape) {
  for (const Column& column : columns) reader.allow(column.key);
  const Column& x = columns[0];
  const Column& y = columns[1];
  Points points;
  points.x = readColumn(reader, x);
  if (columns.size() == 2) {
    points.values = readColumn(reader, y, points.x.size());
  } else {
    points.y = readColumn(reader, y);
    points.values = readRows(reader, x, y, columns[2], points.x.size(), points.y.size());
  }
  points.fault = [&](const char* column, std::size_t index, const std::string& message) {
    return SceneError(elementPath(reader.keyPath(column[0] == 'x' ? x.key : y.key), index),
                      message);
  };
  return make(std::move(points), shape, reader.path());
}

Table Table::make(Points points, const Shape& shape, const std::string& origin) {
  const bool is_flat = shape.beyond == Beyond::kConstant;
  const bool has_two = !points.y.empty();
  checkIncreasing(points.x, "x", points.fault);
  Table table;
  if (has_two) {
    checkIntervals(points.x, "x", points.fault);
    checkIncreasing(points.y, "y", points.fault);
    checkIntervals(points.y, "y", points.fault);
    const TableAxis x(std::move(points.x), is_flat);
    const TableAxis y(std::move(points.y), is_flat);
    table.cells_ = std::make_shared<const Cells>(
        Cells{x, y, makePatches(x, y, points.values, shape.interpolation), shape.interpolation});
  } else {
    checkSteepness(points, TableAxis(points.x, is_flat));
    table = through(std::move(points.x), points.values, shape);
  }
  table.origin_ = origin;
  return table;
}

Table Table::through(Numbers x, const Numbers& y, const Shape& shape) {
  const TableAxis axis(std::move(x), shape.beyond == Beyond::kConstant);
  Table table;
  table.cells_ = std::make_shared<const Cells>(
      Cells{axis, {}, makeCells(axis, y, shape.interpolation), shape.interpolation});
  return table;
}

double Table::derivative(int order, double x) const {
  if (!cells_ || order > kDegree) return std::isnan(x) ? x : 0.0;
  const TableAxis::Place at = cells_->x.find(x);
  double value = evaluateCell(cells_->polynomials[at.cell], at.t, order);
  for (int k = 0; k < order; ++k) value *= at.scale;
  return value;
}

double Table::derivative(Order order, double x, double y) const {
  const TableAxis::Place in_x = cells_->x.find(x);
  const TableAxis::Place in_y = cells_->y->find(y);
  if (order.x > kDegree || order.y > kDegree) return 0.0 * (in_x.t + in_y.t);
  const TableCell* const patch =
      &cells_->polynomials[(in_x.cell * cells_->y->cellCount() + in_y.cell) * (kDegree + 1)];
  TableCell along_x{};
  for (int m = order.x; m <= kDegree; ++m) {
    along_x[static_cast<std::size_t>(m)] = evaluateCell(patch[m], in_y.t, order.y);
  }
  double value = evaluateCell(along_x, in_x.t, order.x);
  for (int k = 0; k < order.x; ++k) value *= in_x.scale;
  for (int k = 0; k < order.y; ++k) value *= in_y.scale;
  return std::isnan(in_x.t) || std::isnan(in_y.t) ? in_x.t + in_y.t : value;
}

int Table::argumentCount() const {
  return cells_ && cells_->y ? 2 : 1;
}

std::vector<double> Table::points(int axis) const {
  if (!cells_) return {};
  return (axis == 0 ? cells_->x : *cells_->y).points();
}

int Table::smoothness() const {
  const Interpolation its = cells_ ? cells_->interpolation : Interpolation::kSmooth;
  return its == Interpolation::kSmooth ? 3 : its == Interpolation::kLinear ? 1 : 0;
}

int Table::degree() const {
  return smoothness() == 3 ? kDegree : smoothness();
}

bool Table::isBounded() const {
  return !cells_ || cells_->x.isFlatBeyond();
}

}  // namespace variator_sim
