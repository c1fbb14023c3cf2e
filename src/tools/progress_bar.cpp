#include "tools/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace variator_sim {
namespace {

std::string formatDuration(double seconds) {
  // A run that would take longer than a year is shown as a year.
  const long whole = std::lround(std::min(seconds, 365.0 * 86400.0));
  char text[32];
  if (whole >= 3600) {
    std::snprintf(text, sizeof text, "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  } else {
    std::snprintf(text, sizeof text, "%ld:%02ld", whole / 60, whole % 60);
  }
  return text;
}

}  // namespace

ProgressBar::ProgressBar(double duration, bool quiet)
    : duration_(duration), enabled_(!quiet && duration > 0.0 && ::isatty(STDERR_FILENO) == 1) {}

void ProgressBar::update(double simulated_time) {
  if (!enabled_) return;
  const Clock::time_point now = Clock::now();
  if (now < next_drawing_) return;
  next_drawing_ = now + std::chrono::milliseconds(100);

  constexpr int kWidth = 24;
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  const double fraction = std::clamp(simulated_time / duration_, 0.0, 1.0);
  const auto filled = static_cast<int>(fraction * kWidth);
  const std::string bar = std::string(static_cast<std::size_t>(filled), '#') +
                          std::string(static_cast<std::size_t>(kWidth - filled), ' ');
  const std::string left =
      fraction > 0.0 ? formatDuration(elapsed * (1.0 - fraction) / fraction) : "unknown";
  std::fprintf(stderr, "\r\033[K[%s] %3.0f %%  %.6g s  %.3g times real time  %s left", bar.c_str(),
               100.0 * fraction, simulated_time, simulated_time / elapsed, left.c_str());
  std::fflush(stderr);
  shown_ = true;
}

void ProgressBar::clear() {
  if (!shown_) return;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace variator_sim
