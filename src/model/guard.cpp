#include "variator_sim/guard.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace variator_sim {

KnotGuard::KnotGuard(Part part, int shaft, std::vector<double> knots)
    : Guard(false), part_(part), shaft_(shaft), knots_(std::move(knots)) {
  std::sort(knots_.begin(), knots_.end());
}

int KnotGuard::count(double x) const {
  return static_cast<int>(std::lower_bound(knots_.begin(), knots_.end(), x) - knots_.begin());
}

int KnotGuard::branch(const StateView& state) const {
  const double x = part_ == Part::kAngle ? state.angle[shaft_] : state.velocity[shaft_];
  const int below = count(x);
  const bool on_knot =
      below < static_cast<int>(knots_.size()) && knots_[static_cast<std::size_t>(below)] == x;
  return on_knot || std::isnan(x) ? kOnEdge : below;
}

bool KnotGuard::mayLeave(const StateBox& box, int branch) const {
  const Interval& x = part_ == Part::kAngle ? box.angle[shaft_] : box.velocity[shaft_];
  return count(x.low) != branch || count(x.high) != branch;
}

}  // namespace variator_sim
