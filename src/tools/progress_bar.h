/// A progress line on a terminal.
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

  /// `simulated_time`: s. Draws at most ten times per second.
  void update(double simulated_time);
  /// Erases the line.
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
