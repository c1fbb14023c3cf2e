#include "variator_sim/table.h"

#include <cmath>
#include <optional>
#include <utility>

#include "model/table_axis.h"

namespace variator_sim {
namespace {

using Numbers = std::vector<double>;

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

/// Returns the error at an entry of the lists `x` and, for other columns, `y`.
Table::Points::Fault faultIn(const ParameterReader& reader, const Table::Column& x,
                             const Table::Column& y) {
  return [&](const char* column, std::size_t index, const std::string& message) {
    const char* const key = column[0] == 'x' ? x.key : y.key;
    return SceneError(elementPath(reader.keyPath(key), index), message);
  };
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

Table Table::read(ParameterReader& reader, const Column& x, const Column& y, const Shape& shape) {
  reader.allow({x.key, y.key});
  Points points;
  points.x = readColumn(reader, x);
  points.values = readColumn(reader, y, points.x.size());
  points.fault = faultIn(reader, x, y);
  return make(std::move(points), shape, reader.path());
}

Table Table::read(ParameterReader& reader, const Column& x, const Column& y, const Column& z,
                  const Shape& shape) {
  reader.allow({x.key, y.key, z.key});
  Points points;
  points.x = readColumn(reader, x);
  points.y = readColumn(reader, y);
  points.values = readRows(reader, x, y, z, points.x.size(), points.y.size());
  points.fault = faultIn(reader, x, y);
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
  // A smooth step is constant nearly all the time.
  const TableAxis& axis = cells_->x;
  const std::vector<TableCell>& cells = cells_->polynomials;
  const bool is_below = x < axis.points().front();
  if (axis.isFlatBeyond() && (is_below || x >= axis.points().back())) {
    return order > 0 ? 0.0 : (is_below ? cells.front() : cells.back())[0];
  }
  const TableAxis::Place at = axis.find(x);
  double value = evaluateCell(cells[at.cell], at.t, order);
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
