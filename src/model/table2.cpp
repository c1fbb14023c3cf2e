#include "variator_sim/table2.h"

#include <array>
#include <cmath>
#include <limits>

#include "model/table_axis.h"

namespace variator_sim {
namespace {

using Numbers = std::vector<double>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kCoefficients = kTableDegree + 1;

/// The polynomial of a cell as a function of the data: the coefficient of t^m is the sum of
/// weight[k][m] times the datum of point first + k. A cell depends on the two points at its ends
/// and one more on either side.
struct Stencil {
  int first = 0;
  std::array<TableCell, 4> weight{};
};

/// Returns one stencil for each cell of an axis.
std::vector<Stencil> makeStencils(const TableAxis& axis, Interpolation interpolation) {
  const Numbers& x = axis.points();
  const auto n = static_cast<int>(x.size());
  const auto at = [&x](int k) { return x[static_cast<std::size_t>(k)]; };
  std::vector<Stencil> stencils(axis.cellCount());
  for (int cell = 0; cell <= n; ++cell) {
    Stencil& stencil = stencils[static_cast<std::size_t>(cell)];
    stencil.first = cell - 2;
    for (int k = 0; k < 4; ++k) {
      const int datum = stencil.first + k;
      if (datum < 0 || datum >= n) continue;
      // Set all data to 0 but this one.
      const auto y = [datum](int point) { return point == datum ? 1.0 : 0.0; };
      const auto d = [&](int left) { return (y(left + 1) - y(left)) / (at(left + 1) - at(left)); };
      const auto slope = [&](int point) {
        const bool is_inside = point > 0 && point + 1 < n;
        if (!is_inside) return axis.isFlatBeyond() ? 0.0 : d(point == 0 ? 0 : n - 2);
        const double left = at(point) - at(point - 1);
        const double right = at(point + 1) - at(point);
        return d(point - 1) * (right / (left + right)) + d(point) * (left / (left + right));
      };
      const auto curvature = [&](int point) {
        if (point == 0 || point + 1 == n) return 0.0;
        return 2.0 * (d(point) - d(point - 1)) / (at(point + 1) - at(point - 1));
      };
      TableCell& c = stencil.weight[static_cast<std::size_t>(k)];
      if (cell == 0 || cell == n) {
        const int end = cell == 0 ? 0 : n - 1;
        c = {y(end), slope(end)};
      } else if (interpolation != Interpolation::kSmooth) {
        const bool is_line = interpolation == Interpolation::kLinear;
        c = {y(cell - 1), is_line ? y(cell) - y(cell - 1) : 0.0};
      } else {
        c = hermiteCell(axis.width(static_cast<std::size_t>(cell)), {y(cell - 1), y(cell)},
                        {slope(cell - 1), slope(cell)}, {curvature(cell - 1), curvature(cell)});
      }
    }
  }
  return stencils;
}

/// Coefficients of t^m u^n of one cell: [m][n].
using Patch = std::array<TableCell, kCoefficients>;

/// Returns the patch of two stencils over the data z, rows by x of `columns` numbers.
Patch makePatch(const Stencil& along_x, const Stencil& along_y, const Numbers& z, int columns) {
  Patch patch{};
  const int rows = static_cast<int>(z.size()) / columns;
  for (int k = 0; k < 4; ++k) {
    const int row = along_x.first + k;
    if (row < 0 || row >= rows) continue;
    TableCell of_row{};
    for (int l = 0; l < 4; ++l) {
      const int column = along_y.first + l;
      if (column < 0 || column >= columns) continue;
      const double datum = z[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                             static_cast<std::size_t>(column)];
      for (std::size_t n = 0; n < kCoefficients; ++n) {
        of_row[n] += along_y.weight[static_cast<std::size_t>(l)][n] * datum;
      }
    }
    for (std::size_t m = 0; m < kCoefficients; ++m) {
      for (std::size_t n = 0; n < kCoefficients; ++n) {
        patch[m][n] += along_x.weight[static_cast<std::size_t>(k)][m] * of_row[n];
      }
    }
  }
  return patch;
}

double evaluatePatch(const Patch& patch, double t, double u, int order_t, int order_u) {
  TableCell in_t{};
  for (std::size_t m = static_cast<std::size_t>(order_t); m < kCoefficients; ++m) {
    in_t[m] = evaluateCell(patch[m], u, order_u);
  }
  return evaluateCell(in_t, t, order_t);
}

void checkAxis(const Numbers& x, const char* column, const Table::Points::Fault& fault) {
  checkIncreasing(x, column, fault);
  for (std::size_t k = 1; k < x.size(); ++k) {
    if (x[k] - x[k - 1] < 1e100 && x[k] - x[k - 1] > 1e-100) continue;
    throw fault(column, k,
                formatNumber(x[k]) + " behind " + formatNumber(x[k - 1]) +
                    "; allowed: intervals from 1e-100 to 1e100");
  }
}

Numbers readRows(ParameterReader& reader, const Table2::Keys& keys, std::size_t rows,
                 std::size_t columns) {
  const std::string path = reader.keyPath(keys.values);
  const ParameterTree* list = reader.raw(keys.values);
  const std::string expected = "a list of " + std::to_string(rows) + " rows, one for each of " +
                               keys.x + ", of " + std::to_string(columns) +
                               " numbers, one for each of " + keys.y;
  if (list == nullptr) throw SceneError(path, "missing; expected " + expected);
  const auto size_of = [](const ParameterTree& value) {
    return value.kind() == ParameterTree::Kind::kList ? value.asList().size() : 0;
  };
  if (size_of(*list) != rows) {
    throw SceneError(path, list->kind() == ParameterTree::Kind::kList
                               ? std::to_string(size_of(*list)) + " rows; expected " + expected
                               : list->toText() + "; expected " + expected);
  }
  Numbers z;
  for (std::size_t i = 0; i < rows; ++i) {
    const std::string row_path = elementPath(path, i);
    const ParameterTree& row = list->asList()[i];
    if (size_of(row) != columns) {
      throw SceneError(row_path, row.toText() + "; expected " + expected);
    }
    for (std::size_t j = 0; j < columns; ++j) {
      z.push_back(ParameterReader::toNumber(row.asList()[j], elementPath(row_path, j),
                                            Range::between(-1e100, 1e100)));
    }
  }
  return z;
}

}  // namespace

struct Table2::Surface {
  TableAxis x;
  TableAxis y;
  Interpolation interpolation;
  std::vector<Patch> patches;  ///< one per cell, row by row

  const Patch& patch(std::size_t cell_x, std::size_t cell_y) const {
    return patches[cell_x * y.cellCount() + cell_y];
  }
};

Table2 Table2::read(ParameterReader& reader, const Keys& keys, const Table::Shape& shape) {
  reader.allow({keys.x, keys.y, keys.values});
  Table::Points points;
  points.x = readColumn(reader, {keys.x, Range::any(), keys.units[0]});
  points.y = readColumn(reader, {keys.y, Range::any(), keys.units[1]});
  points.values = readRows(reader, keys, points.x.size(), points.y.size());
  for (double& z : points.values) z = keys.units[2].toSi(z);
  points.fault = [&](const char* column, std::size_t index, const std::string& message) {
    const char* const key = column[0] == 'x' ? keys.x : keys.y;
    return SceneError(elementPath(reader.keyPath(key), index), message);
  };
  return make(std::move(points), shape, reader.path());
}

Table2 Table2::make(Table::Points points, const Table::Shape& shape, const std::string& origin) {
  checkAxis(points.x, "x", points.fault);
  checkAxis(points.y, "y", points.fault);
  const bool is_flat = shape.beyond == Table::Beyond::kConstant;
  const auto columns = static_cast<int>(points.y.size());
  Surface surface{TableAxis(std::move(points.x), is_flat),
                  TableAxis(std::move(points.y), is_flat),
                  shape.interpolation,
                  {}};
  const std::vector<Stencil> along_x = makeStencils(surface.x, shape.interpolation);
  const std::vector<Stencil> along_y = makeStencils(surface.y, shape.interpolation);
  surface.patches.reserve(along_x.size() * along_y.size());
  for (const Stencil& row : along_x) {
    for (const Stencil& column : along_y) {
      surface.patches.push_back(makePatch(row, column, points.values, columns));
    }
  }
  return Table2(std::make_shared<const Surface>(std::move(surface)), origin);
}

double Table2::derivative(Order order, double x, double y) const {
  const TableAxis::Place in_x = surface_->x.find(x);
  const TableAxis::Place in_y = surface_->y.find(y);
  if (order.x > kTableDegree || order.y > kTableDegree) return 0.0 * (in_x.t + in_y.t);
  const Patch& patch = surface_->patch(in_x.cell, in_y.cell);
  double value = evaluatePatch(patch, in_x.t, in_y.t, order.x, order.y);
  for (int k = 0; k < order.x; ++k) value *= in_x.scale;
  for (int k = 0; k < order.y; ++k) value *= in_y.scale;
  return std::isnan(in_x.t) || std::isnan(in_y.t) ? in_x.t + in_y.t : value;
}

const std::vector<double>& Table2::pointsX() const {
  return surface_->x.points();
}
const std::vector<double>& Table2::pointsY() const {
  return surface_->y.points();
}
int Table2::smoothness() const {
  return smoothnessOf(surface_->interpolation);
}
int Table2::degree() const {
  return smoothness() == 3 ? kTableDegree : smoothness();
}
bool Table2::isBounded() const {
  return surface_->x.isFlatBeyond();
}

}  // namespace variator_sim
