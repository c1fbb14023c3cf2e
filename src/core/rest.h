/// When a motion has come to rest, so that stepping it changes nothing any more.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

/// Watches the largest rate |x'| of a motion in units of its tolerance per second. Rates that fall
/// to a kFall-th within a time T, stay below it for as long again (a slow oscillation's rate falls
/// only while its acceleration passes zero), and go on falling (a fast transient may end in a slow
/// motion that goes on), fall about like exp(-t ln kFall / T), and what is left of the motion is at
/// most
///     rate T / ln kFall.
/// Below kLeft (of the tolerance) the motion is at rest: the state stays as it is. The bound holds
/// as long as rates do not grow again, which an autonomous scene near a stable equilibrium does not
/// make them do (from a saddle they do, slowly at first); rates that rise within the time begin it
/// anew.
class RestWatch {
 public:
  /// What is left of a motion is counted over `horizon` s at least: behind what settles fast
  /// something slow may go on.
  explicit RestWatch(double horizon = 0.0) : horizon_(horizon) {}
  void reset() {
    start_rate_ = 0.0;
    steps_ = 0;
  }
  /// A step ended at `time` with the rate `rate` >= 0 (1/s). True when that is rest.
  bool noteStep(double time, double rate) {
    if (rate == 0.0) return true;
    if (steps_ == 0 || rate > start_rate_) {
      begin(time, rate);
      return false;
    }
    ++steps_;
    if (rate * kFall > start_rate_) {
      fallen_ = false;
      return false;
    }
    if (!fallen_) {
      fallen_ = true;
      fall_time_ = time - start_time_;
      fall_rate_ = rate;
    }
    // stays there as long again
    if (time - start_time_ < 2.0 * fall_time_ || steps_ < kSteps) return false;
    const bool goes_on = rate * kGoesOn <= fall_rate_;
    const double left = rate * std::max(fall_time_, horizon_) / std::log(kFall);
    begin(time, rate);
    return goes_on && left <= kLeft;
  }

  /// A tenth of the error allowed.
  static constexpr double kLeft = 0.1;

 private:
  void begin(double time, double rate) {
    start_time_ = time;
    start_rate_ = rate;
    steps_ = 1;
    fallen_ = false;
  }
  static constexpr double kFall = 16.0;
  static constexpr double kGoesOn = 4.0;  // an exponential's would fall by kFall once more
  static constexpr int kSteps = 4;        // a moment's low of an oscillation is not rest
  double horizon_;
  double start_time_ = 0.0;
  double start_rate_ = 0.0;
  bool fallen_ = false;
  double fall_time_ = 0.0;
  double fall_rate_ = 0.0;
  int steps_ = 0;
};

}  // namespace variator_sim
