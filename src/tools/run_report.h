/// Tells of a run on standard error: a progress line, and the figures of `simulate --stats`.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

#include "model/number_text.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// Shows nothing unless standard error is a terminal and the run takes longer than a second.
class ProgressBar {
 public:
  /// `quiet`: never show anything, because the terminal shows the samples.
  ProgressBar(double duration, bool quiet)
      : duration_(duration), enabled_(!quiet && duration > 0.0 && ::isatty(STDERR_FILENO) == 1) {}
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// `simulated_time`: s. Draws at most ten times per second.
  void update(double simulated_time) {
    if (!enabled_) return;
    const Clock::time_point now = Clock::now();
    if (now < next_drawing_) return;
    next_drawing_ = now + std::chrono::milliseconds(100);

    constexpr int kWidth = 24;
    const double elapsed = std::chrono::duration<double>(now - start_).count();
    const double fraction = std::clamp(simulated_time / duration_, 0.0, 1.0);
    const std::string bar(static_cast<std::size_t>(fraction * kWidth), '#');
    const std::string left =
        fraction > 0.0 ? formatDuration(elapsed * (1.0 - fraction) / fraction) : "unknown";
    std::fprintf(stderr, "\r\033[K[%-*s] %3.0f %%  %.6g s  %.3g times real time  %s left", kWidth,
                 bar.c_str(), 100.0 * fraction, simulated_time, simulated_time / elapsed,
                 left.c_str());
    std::fflush(stderr);
    shown_ = true;
  }
  /// Erases the line.
  void clear() {
    if (!shown_) return;
    std::fputs("\r\033[K", stderr);
    std::fflush(stderr);
    shown_ = false;
  }

 private:
  using Clock = std::chrono::steady_clock;

  static std::string formatDuration(double seconds) {
    // A run that would take longer than a year is shown as a year.
    const long whole = std::lround(std::min(seconds, 365.0 * 86400.0));
    const std::string minutes = printed(whole < 3600 ? "%ld" : "%02ld", whole / 60 % 60);
    return (whole < 3600 ? "" : printed("%ld:", whole / 3600)) + minutes +
           printed(":%02ld", whole % 60);
  }

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
