// The polynomials of tables.
#include <algorithm>
#include <cmath>

#include "model/table_axis.h"

namespace variator_sim {
namespace {

using Numbers = std::vector<double>;
constexpr std::size_t kCoefficients = kTableDegree + 1;

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

}  // namespace

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

std::vector<TableCell> makeCells(const TableAxis& axis, const Numbers& y,
                                 Interpolation interpolation) {
  const TableDerivatives at = calcDerivatives(axis, y, true);
  std::vector<TableCell> cells;
  for (std::size_t k = 0; k <= y.size(); ++k) {
    cells.push_back(makeCell(axis, y, at, k, interpolation));
  }
  return cells;
}

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

}  // namespace variator_sim
