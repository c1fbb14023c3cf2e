/// Tables of two variables: a function through the points of a grid.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/parameter_tree.h"
#include "variator_sim/table.h"

namespace variator_sim {

/// z(x, y) through points (x_i, y_j, z_ij), x_i and y_j strictly increasing and spaced as one
/// likes: the tensor product of one interpolation along x and one along y (table.h). kLinear is
/// bilinear between four points.
///
/// kSmooth is two times continuously differentiable for all real x and y, the edges included. Along
/// each axis it is a polynomial of degree
/// five between two points with the values, slopes s_k and second derivatives q_k of table.h, but
/// without their limits: so it is linear in the data, and the order of the two does not matter.
///     s_k = (h_r d_l + h_l d_r) / (h_l + h_r),   q_k = 2 (d_r - d_l) / (h_l + h_r)
/// Planes and bilinear data are met exactly (with kConstant: away from the edges); near steep bends
/// it may overshoot, as a table of one variable does not.
///
/// Beyond the edges, along either axis:
///     Table::Beyond::kConstant  the value at the edge; a smooth z levels off (s = q = 0) towards
///     it Table::Beyond::kLinear    straight lines of the slope between the last two points (q = 0)
class Table2 {
 public:
  /// Orders of the derivative by x and by y.
  struct Order {
    int x = 0;
    int y = 0;
  };
  /// Keys of a scene: x, y, and z as a list of one row per x, each with a value per y; and the
  /// units of their numbers.
  struct Keys {
    const char* x;
    const char* y;
    const char* values;
    Unit units[3] = {};
  };

  /// Reads a table with two points at least along each axis. Throws SceneError.
  static Table2 read(ParameterReader& reader, const Keys& keys, const Table::Shape& shape);
  /// Makes a table as Table::make does.
  static Table2 make(Table::Points points, const Table::Shape& shape, const std::string& origin);

  /// Evaluations allocate nothing and do not throw; NaN gives NaN. [loop]
  double value(double x, double y) const { return derivative({}, x, y); }
  /// Returns d^(m + n) z / dx^m dy^n; 0 if m or n is above five.
  double derivative(Order order, double x, double y) const;
  /// Returns the x_i and the y_j, at which derivatives from that of order `smoothness` on jump.
  const std::vector<double>& pointsX() const;
  const std::vector<double>& pointsY() const;
  int smoothness() const;  ///< as Table's
  int degree() const;      ///< the same, along each axis
  /// True when z is bounded: nothing grows beyond the edges.
  bool isBounded() const;
  /// Returns the path of its dictionary in the scene.
  const std::string& origin() const { return origin_; }

 private:
  struct Surface;
  Table2(std::shared_ptr<const Surface> surface, std::string origin)
      : surface_(std::move(surface)), origin_(std::move(origin)) {}
  std::shared_ptr<const Surface> surface_;
  std::string origin_;
};

}  // namespace variator_sim
