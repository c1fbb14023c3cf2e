/// The instant that times of nodes are counted from.
#pragma once

#include <cmath>
#include <limits>

namespace variator_sim {

/// Differences from `time` that are no more than this no longer change it reliably. [loop]
inline double resolutionOf(double time) {
  return 4.0 * std::numeric_limits<double>::epsilon() * std::abs(time);
}

/// Times inside a motion are counted from its last beginning (start, command, jump), so that what
/// follows is resolved as finely after 1e7 s as after none. The origin is kept to twice a double's
/// digits.
class TimeOrigin {
 public:
  double absolute(double t) const { return origin_ + (origin_rest_ + t); }
  double relative(double time) const { return (time - origin_) - origin_rest_; }
  double time() const { return origin_; }
  /// The part of it that a double rounds off.
  double rest() const { return origin_rest_; }

  /// Times are counted from `time`, which is 0 then to the bit, on.
  void moveTo(double time) {
    origin_ = time;
    origin_rest_ = 0.0;
  }
  /// Times are counted from `t`, as they are counted now, on.
  void moveBy(double t) {
    // The sum of two doubles and what it rounds off (Knuth: The Art of Computer
    // Programming, 4.2.2).
    const double added = origin_rest_ + t;
    const double sum = origin_ + added;
    const double part = sum - origin_;
    origin_rest_ = (origin_ - (sum - part)) + (added - part);
    origin_ = sum;
  }

 private:
  double origin_ = 0.0;
  double origin_rest_ = 0.0;  // what a double rounds off that
};

}  // namespace variator_sim
