/// One axis of a table: its points, and polynomials of degree five between them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "variator_sim/table.h"

namespace variator_sim {

constexpr int kTableDegree = Table::kDegree;
/// Polynomials of degree five in a cell's coordinate.
using TableCell = std::array<double, kTableDegree + 1>;

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

/// Slopes s and second derivatives q at the points, as table.h states them.
struct TableDerivatives {
  std::vector<double> s;
  std::vector<double> q;
};
/// `is_limited`: as of a table of one variable.
TableDerivatives calcDerivatives(const TableAxis& axis, const std::vector<double>& y,
                                 bool is_limited);

/// Returns the polynomials of a table of one variable.
std::vector<TableCell> makeCells(const TableAxis& axis, const std::vector<double>& y,
                                 Interpolation interpolation);
/// Returns those of one of two variables, with the values z row by row, in t: of a cell of both
/// axes kTableDegree + 1 polynomials in u, the coefficients of t^m.
std::vector<TableCell> makePatches(const TableAxis& x, const TableAxis& y,
                                   const std::vector<double>& z, Interpolation interpolation);

/// Returns n!/(n - order)!.
inline double fallingFactorial(int n, int order) {
  double product = 1.0;
  for (int k = 0; k < order; ++k) product *= n - k;
  return product;
}

/// Returns d^order/dt^order of a polynomial at t.
inline double evaluateCell(const TableCell& c, double t, int order) {
  switch (order) {
    case 0:
      return c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))));
    case 1:
      return c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * (5.0 * c[5]))));
    case 2:
      return 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * (20.0 * c[5])));
    default:
      break;
  }
  double sum = 0.0 * t;
  for (int n = kTableDegree; n >= order; --n) {
    sum = sum * t + fallingFactorial(n, order) * c[static_cast<std::size_t>(n)];
  }
  return sum;
}

}  // namespace variator_sim
