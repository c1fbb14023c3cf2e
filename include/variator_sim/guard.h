/// Switching functions of laws: kinks (abs, min, max), jumps (sign) and the points of tables.
#pragma once

#include <bitset>
#include <limits>
#include <memory>
#include <vector>

#include "variator_sim/types.h"

namespace variator_sim {

/// The interval from low to high; the ends may be infinite.
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
  const Interval* input = nullptr;    ///< one per input of the scene; null: unknown
};

/// A set of parts of the state, in the order of LinearValue::state.
using StateSet = std::bitset<3 * kMaxShafts>;

/// A value that is linear in the state and the time, up to a constant.
struct LinearValue {
  double time = 0.0;
  double state[3 * kMaxShafts] = {};  ///< by angles, velocities, accelerations: kMaxShafts of each
};

/// A switching function: it tells in which mode of a law a state lies. In one mode the law is
/// smooth; a step ends where the mode changes, however briefly.
///
/// Evaluations are const, allocate nothing, take no lock and do not throw.
class Guard {
 public:
  /// The mode of a state exactly at a zero of the switching function, or of NaN.
  static constexpr int kOnEdge = -1000000;

  virtual ~Guard() = default;
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;

  /// Returns a number that is the same throughout one mode.
  virtual int branch(const StateView& state) const = 0;
  /// False when all of `box` certainly lies in mode `branch`, or, for kOnEdge, at the zero.
  virtual bool mayLeave(const StateBox& box, int branch) const = 0;
  /// True when the switching function is no more than rounding in all of `box`: event localization
  /// must end for a state that settles at a zero.
  virtual bool isRounding(const StateBox& /*box*/) const { return false; }
  /// True when only the mode at single states is known: `mayLeave` is always true.
  virtual bool isOpaque() const { return false; }
  /// Returns the switching function, in any unit, for linear and opaque guards and those with a
  /// `rate`; for guards with `bounds` the value that these bound.
  virtual double distance(const StateView& /*state*/) const { return 0.0; }
  /// Encloses the rate of the switching function, 1/s, along motions in `box`; infinite if it is
  /// not known.
  virtual Interval rate(const StateBox& /*box*/) const {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    return {-kInfinity, kInfinity};
  }
  /// Returns the linear value of a linear guard; nullptr for others.
  virtual const LinearValue* linear() const { return nullptr; }
  /// Returns the open interval of distances in which a guard that is linear, or has a `rate`, keeps
  /// its mode, which is not kOnEdge.
  virtual Interval bounds(int /*branch*/) const { return {}; }
  /// Returns the components of the state that the guard or its `rate` may read, one bit for each of
  /// those of LinearValue.
  virtual StateSet reads() const { return ~StateSet{}; }
  /// True when the mode may change while the shafts do not: the law reads the time or an input.
  virtual bool readsTime() const { return true; }
  /// True when the guard reads a commanded input.
  virtual bool readsInputs() const { return true; }
  /// True when the law itself may jump at a mode change, and not only a derivative of it.
  bool jumps() const { return jumps_; }
  /// Returns the function that has the modes, as formulas write it ("if", "abs"); "" for a table
  /// and for a law in C++.
  const char* function() const { return function_; }

 protected:
  explicit Guard(bool jumps, const char* function = "") : jumps_(jumps), function_(function) {}

 private:
  bool jumps_;
  const char* function_;
};

using GuardPtr = std::shared_ptr<const Guard>;

}  // namespace variator_sim
