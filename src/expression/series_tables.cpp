#include "expression/series_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim::expression {
namespace {

constexpr double kFactorial[] = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0};

/// Calls `use` with the point from which each piece is counted: the lower one of its two, for the
/// lowest piece the first; third derivatives are taken slightly inside of the piece.
template <class Use>
void forEachPiece(const std::vector<double>& points, Use use) {
  for (std::size_t k = 0; k <= points.size(); ++k) {
    const double x = k == 0 ? points.front() : points[k - 1];
    use(x, k == 0 ? std::nextafter(x, -std::numeric_limits<double>::infinity()) : x);
  }
}

}  // namespace

DenseTable cut(const Table& table, const int (&order)[2]) {
  const bool has_two = table.argumentCount() == 2;
  DenseTable made = {table.origin(), {table.points(0)}, {}};
  if (has_two) made.points.push_back(table.points(1));
  forEachPiece(made.points[0], [&](double x, double inside) {
    if (!has_two) {
      for (int i = 0; i <= Table::kDegree; ++i) {
        const int n = order[0] + i;
        const double value =
            n > Table::kDegree ? 0.0 : table.derivative(n, n < table.smoothness() ? x : inside);
        made.pieces.push_back(value / kFactorial[i]);
      }
      return;
    }
    forEachPiece(made.points[1], [&](double /*y*/, double inside_y) {
      for (int i = 0; i <= Table::kDegree; ++i) {
        for (int j = 0; j <= Table::kDegree; ++j) {
          const int m = order[0] + i;
          const int n = order[1] + j;
          const bool is_none = std::max(m, n) > Table::kDegree;
          made.pieces.push_back((is_none ? 0.0 : table.derivative({m, n}, inside, inside_y)) /
                                (kFactorial[i] * kFactorial[j]));
        }
      }
    });
  });
  return made;
}

}  // namespace variator_sim::expression
