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

/// Reads the list at `key` in SI units: `size` numbers, or any number from two on when it is 0.
std::vector<double> readColumn(ParameterReader& reader, const Table::Column& column,
                               std::size_t size = 0);

/// Throws SceneError unless the numbers of `column` are in strictly increasing order.
void checkIncreasing(const std::vector<double>& x, const char* column,
                     const Table::Points::Fault& fault);

/// Returns Table::smoothness.
int smoothnessOf(Interpolation interpolation);

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

/// Returns the polynomial with the values y, slopes s and second derivatives q at the ends of a
/// cell of width h.
inline TableCell hermiteCell(double h, const double (&y)[2], const double (&s)[2],
                             const double (&q)[2]) {
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

}  // namespace variator_sim
