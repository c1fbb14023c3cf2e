/// How much a motion may spend without getting on.
#pragma once

#include <algorithm>

namespace variator_sim {

/// Counts the steps that are made within one second of simulated time. They are not counted by
/// advance: how a motion is cut may not change it.
class Progress {
 public:
  /// At most `most` within a second.
  explicit Progress(int most) : most_(most) {}

  /// A motion begins at `time`.
  void begin(double time) {
    window_start_ = time;
    made_ = 0;
    refused_ = 0;
  }
  /// One more goes on from `time`. False when there have been too many. [loop]
  bool count(double time) {
    if (time - window_start_ >= 1.0) {
      window_start_ = time;
      made_ = 0;
    }
    if (made_ >= most_) return false;
    ++made_;
    return true;
  }
  /// How many there would be in a second as they were up to `time`.
  double rateAt(double time) const { return most_ / (time - window_start_); }

  /// A step was accepted after `refusals` shorter and shorter ones. [loop]
  void noteRefusals(long refusals) {
    refused_ = std::max(0L, refused_ + refusals - kUsualRefusals);
  }
  /// True when the last steps took so many that rounding decides and not their lengths; not again
  /// until there are as many more. [loop]
  bool areRefused() {
    if (refused_ < kMostRefusals) return false;
    refused_ = 0;
    return true;
  }

 private:
  /// Refusals of a step, of which an event or the end of a series takes some tens, but not always.
  static constexpr long kUsualRefusals = 10;
  static constexpr long kMostRefusals = 100000;
  const int most_;
  double window_start_ = 0.0;
  int made_ = 0;
  long refused_ = 0;
};

}  // namespace variator_sim
