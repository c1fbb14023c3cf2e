/// Tables: a function of one or two variables through given points.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "variator_sim/errors.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/units.h"

namespace variator_sim {

/// The function between two points.
enum class Interpolation {
  kSmooth,  ///< two times continuously differentiable, as stated at the tables
  kLinear,  ///< straight lines, with a kink at each point
  kHold     ///< the value of the lower point, with a jump at each point
};

/// y(x) through points (x_k, y_k), x_k strictly increasing and spaced as one likes. Kinks and jumps
/// of kLinear and kHold are events of the motion (expression/guards.h).
///
/// kSmooth is two times continuously differentiable for every real x, the ends included: a torque
/// law that reads it has a rate with a continuous derivative. Between two points a polynomial of
/// degree five with the values y_k, the slopes s_k and the second derivatives q_k at both. With h
/// the width of an interval, d = (y_{k+1} - y_k) / h its slope, l and r the intervals left and
/// right of point k:
///     s_k = (h_r d_l + h_l d_r) / (h_l + h_r)   (the parabola through three points), limited to
///           0 <= s_k <= 5/4 min(d_l, d_r) where y rises; 0 where d_l d_r <= 0
///     q_k = 2 (d_r - d_l) / (h_l + h_r), limited in each neighbouring interval to what keeps the
///           polynomial's Bezier points in order: where y rises, from the left end of an interval
///           -4 s_k/h <= q_k <= (10 d - 8 s_k)/h, from its right end the mirror image
/// and both mirrored where y falls. So y is monotone between two points wherever the data are: it
/// overshoots nowhere, and a table of positive values stays positive. Parabolas (away from the
/// ends, the vertex and sharp bends) and straight lines are met exactly. After Dougherty, Edelman,
/// Hyman: Nonnegativity-, monotonicity-, or convexity-preserving cubic and quintic Hermite
/// interpolation, Mathematics of Computation 52 (1989) 471-494.
///
/// Beyond the ends:
///     kConstant  the first and the last value; a smooth y levels off (s = q = 0) at both ends
///     kLinear    the straight lines through the first two and through the last two points
///
/// z(x, y) through the points (x_i, y_j, z_ij) of a grid is the tensor product of one such function
/// along x and one along y: kLinear is bilinear between four points. A smooth one has no limits on
/// s_k and q_k: so it is linear in the data, and the order of the two does not matter. Planes and
/// bilinear data are met exactly (with kConstant: away from the edges); near steep bends it may
/// overshoot, as a table of one variable does not.
class Table {
 public:
  enum class Beyond { kConstant, kLinear };
  static Choices<Beyond> beyondWords() {
    return {{"constant", Beyond::kConstant}, {"linear", Beyond::kLinear}};
  }
  /// Highest degree of the polynomials: derivatives of higher order are 0.
  static constexpr int kDegree = 5;
  struct Shape {
    Shape(Beyond its_beyond, Interpolation its_interpolation = Interpolation::kSmooth)
        : beyond(its_beyond), interpolation(its_interpolation) {}
    Beyond beyond;
    Interpolation interpolation;
  };
  /// Orders of the derivative by x and by y.
  struct Order {
    int x = 0;
    int y = 0;
  };
  /// A list of numbers in a scene.
  struct Column {
    const char* key;
    Range range = {};
    Unit unit = {};  ///< of the list's numbers
  };
  /// Points that were read, and the error that tells of entry `index` of `column`, "x", "y" or
  /// "values", where it stands in the scene or in a file.
  struct Points {
    using Fault = std::function<SceneError(const char* column, std::size_t index,
                                           const std::string& message)>;
    std::vector<double> x;
    std::vector<double> y;       ///< of a table of two variables
    std::vector<double> values;  ///< of a table of two variables row by row, a value for each y
    Fault fault;
  };

  /// Makes y = 0.
  Table() = default;
  /// Makes a table through the points (x, y), two at least, x strictly increasing.
  static Table through(std::vector<double> x, const std::vector<double>& y, const Shape& shape);
  /// Makes a table of points that were read at `origin` of a scene, two at least: of two variables
  /// if there are y. Throws SceneError unless x, and y, are strictly increasing.
  static Table make(Points points, const Shape& shape, const std::string& origin);
  /// Reads two lists of equally many numbers, two at least, x strictly increasing; or those of a
  /// table of two variables: x, y, and z, a list of one row per x, each with a value per y. Throws
  /// SceneError.
  static Table read(ParameterReader& reader, const std::vector<Column>& columns,
                    const Shape& shape);

  int argumentCount() const;
  /// Evaluations allocate nothing and do not throw; NaN gives NaN. [loop]
  double value(double x) const { return derivative(0, x); }      ///< y
  double slope(double x) const { return derivative(1, x); }      ///< dy/dx
  double curvature(double x) const { return derivative(2, x); }  ///< d2y/dx2
  /// Returns d^order y/dx^order; right-hand where it jumps; from the sixth on 0.
  double derivative(int order, double x) const;
  /// The same of two variables: z, and d^(m + n) z / dx^m dy^n.
  double value(double x, double y) const { return derivative({}, x, y); }
  double derivative(Order order, double x, double y) const;
  /// Returns the x_k (axis 0) or the y_k, at which derivatives from that of order `smoothness` on
  /// jump.
  std::vector<double> points(int axis = 0) const;
  /// 3, of kLinear 1, of kHold 0.
  int smoothness() const;
  /// Highest order of a derivative, along an axis, that is not 0: 5, 1 or 0.
  int degree() const;
  /// True when the table is bounded: nothing grows beyond the ends.
  bool isBounded() const;
  /// Returns the path of its dictionary in the scene; empty for a table that was not read.
  const std::string& origin() const { return origin_; }

 private:
  struct Cells;
  std::shared_ptr<const Cells> cells_;
  std::string origin_;
};

}  // namespace variator_sim
