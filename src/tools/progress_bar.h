/// A line on a terminal that shows how far a long run has come.
#pragma once

#include <chrono>

namespace variator_sim {

/// Shows nothing unless standard error is a terminal and the run takes longer than a second.
class ProgressBar {
 public:
  /// `quiet`: never show anything, because the terminal shows the samples.
  ProgressBar(double duration, bool quiet);
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// `simulated_time`: how far the motion has come, s. Draws at most ten times per second.
  void update(double simulated_time);
  /// Takes the line away.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;

  double duration_;
  bool enabled_;
  bool shown_ = false;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_drawing_ = start_ + std::chrono::seconds(1);
};

}  // namespace variator_sim
