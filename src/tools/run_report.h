/// Tells of a run on standard error: a progress line, and the figures of `simulate --stats`.
#pragma once

#include <chrono>
#include <cstdint>

#include "variator_sim/simulation.h"

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

/// Wall time, s, of each part of the run.
struct WallTimes {
  double simulation = 0.0;  ///< stepping and samples
  double sampling = 0.0;    ///< the samples' part of it
  double output = 0.0;      ///< formatting and writing
};

/// Prints to standard error. `tracks_energy`: the energies were integrated.
void printStatistics(Simulation& simulation, bool tracks_energy, const WallTimes& wall,
                     std::uint64_t samples);

}  // namespace variator_sim
