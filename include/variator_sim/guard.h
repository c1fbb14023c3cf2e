/// Where a law changes its branch: kinks (abs, min, max), jumps (sign) and the points of tables.
#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "variator_sim/types.h"

namespace variator_sim {

/// All numbers from low to high; the ends may be infinite.
struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// A set of states: each part anywhere in its interval. Arrays of s entries.
struct StateBox {
  Interval time;                      ///< s
  Interval angle[kMaxShafts];         ///< rad
  Interval velocity[kMaxShafts];      ///< rad/s
  Interval acceleration[kMaxShafts];  ///< rad/s^2
  const Interval* input = nullptr;    ///< of each input of the scene; null: nothing is known
};

/// A value that is linear in the state and the time, less a constant.
struct LinearValue {
  double time = 0.0;
  double state[3 * kMaxShafts] = {};  ///< by angles, velocities, accelerations: kMaxShafts of each
};

/// Tells on which branch of a law a state lies. On one branch the law is smooth; a step ends where
/// the branch changes, however briefly it does.
///
/// Evaluations are const, allocate nothing, take no lock and do not throw.
class Guard {
 public:
  /// Of a state from which no branch can be told: exactly on the edge, or NaN.
  static constexpr int kOnEdge = -1000000;

  virtual ~Guard() = default;
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;

  /// A number that is the same on one branch.
  virtual int branch(const StateView& state) const = 0;
  /// False when all of `box` certainly lies on `branch`, or, of kOnEdge, on the edge.
  virtual bool mayLeave(const StateBox& box, int branch) const = 0;
  /// True when the distance to the edge is no more than rounding in all of `box`: a state that
  /// settles on an edge is not to be searched for ever.
  virtual bool isRounding(const StateBox& /*box*/) const { return false; }
  /// True when nothing is known of it but its branch at single states: `mayLeave` is always true.
  virtual bool isOpaque() const { return false; }
  /// The signed distance to the edge, in whatever unit; of guards with a `rate`, linear and opaque
  /// ones. Of those with `bounds` it is the value that they bound.
  virtual double distance(const StateView& /*state*/) const { return 0.0; }
  /// Encloses the rate of the distance, 1/s, along motions in `box`; infinite where it is not
  /// known.
  virtual Interval rate(const StateBox& /*box*/) const {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    return {-kInfinity, kInfinity};
  }
  /// How the value of a linear guard follows from the state and the time; nullptr of others.
  virtual const LinearValue* linear() const { return nullptr; }
  /// Between which distances a guard that is linear, or has a `rate`, keeps a branch, not kOnEdge;
  /// they themselves do not count.
  virtual Interval bounds(int /*branch*/) const { return {}; }
  /// The parts of the state that it, or its `rate`, may read: a bit for each of those of
  /// LinearValue.
  virtual unsigned reads() const { return ~0U; }
  /// True when it may change while the shafts stay as they are: it reads the time or an input.
  virtual bool readsTime() const { return true; }
  /// True when it reads a commanded input.
  virtual bool readsInputs() const { return true; }
  /// True when the law itself may jump where the branch changes, and not only a derivative of it.
  bool jumps() const { return jumps_; }
  /// The function that has the branches, as formulas write it ("if", "abs"); "" for a table and for
  /// a law in C++.
  const char* function() const { return function_; }

 protected:
  explicit Guard(bool jumps, const char* function = "") : jumps_(jumps), function_(function) {}

 private:
  bool jumps_;
  const char* function_;
};

using GuardPtr = std::shared_ptr<const Guard>;

}  // namespace variator_sim
