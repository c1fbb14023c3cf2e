/// Switching functions of laws: kinks (abs, min, max), jumps (sign) and the points of tables.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "variator_sim/expression/tape.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// A switching function: the value of a formula, between whose points a law is smooth. Its
/// evaluations allocate nothing and do not throw.
class Guard {
 public:
  /// The mode of a state exactly at a point, or of NaN.
  static constexpr int kOnEdge = -1000000;

  /// `function`: that has the modes, as formulas write it ("if", "abs"); "" for a table. `jumps`:
  /// the law itself may jump at a point, and not only a derivative of it.
  Guard(expression::Tape value, std::vector<double> points, bool jumps, const char* function)
      : value_(std::move(value)), points_(std::move(points)), jumps_(jumps), function_(function) {}

  /// Returns the number of points below the value at `state`, or kOnEdge.
  int branch(const StateView& state) const;
  bool jumps() const { return jumps_; }
  const char* function() const { return function_; }

 private:
  expression::Tape value_;
  std::vector<double> points_;
  bool jumps_;
  const char* function_;
};

using GuardPtr = std::shared_ptr<const Guard>;

}  // namespace variator_sim
