// Timed loops that do nothing, without ROS: the price of waking at a rate, and how late one wakes.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <vector>

#include "realtime/timed_loop.h"

namespace {

using variator_sim::benchmark::steadyTime;
using variator_sim::benchmark::TimedLoop;

/// Once a second, when asked: begin and end of that second (s), ticks, ticks more than one period
/// late, lateness p50 and p99 (s).
void run(double rate, bool reporting) {
  TimedLoop loop(rate);
  if (!reporting) {
    for (;;) loop.wait();
  }
  std::vector<std::int64_t> lateness;
  lateness.reserve(static_cast<std::size_t>(2.0 * rate) + 1);
  std::int64_t overruns = 0;
  std::int64_t begin = steadyTime();
  for (;;) {
    const std::int64_t late = loop.wait();
    lateness.push_back(late);
    if (late > loop.period()) ++overruns;
    if (static_cast<double>(lateness.size()) < rate) continue;
    const std::int64_t end = steadyTime();
    std::sort(lateness.begin(), lateness.end());
    const std::size_t count = lateness.size();
    std::printf("%.6f %.6f %zu %lld %.9f %.9f\n", static_cast<double>(begin) / 1e9,
                static_cast<double>(end) / 1e9, count, static_cast<long long>(overruns),
                static_cast<double>(lateness[count / 2]) / 1e9,
                static_cast<double>(lateness[count * 99 / 100]) / 1e9);
    std::fflush(stdout);
    lateness.clear();
    overruns = 0;
    begin = end;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const double rate = argc > 1 ? std::atof(argv[1]) : 0.0;
  const int threads = argc > 2 ? std::atoi(argv[2]) : 1;
  const bool reporting = argc > 3 && std::strcmp(argv[3], "--report") == 0;
  if (!(rate > 0.0) || threads < 1 || (argc > 3 && !reporting)) {
    std::fprintf(stderr, "usage: bare_loop RATE [THREADS [--report]]\n");
    return 2;
  }
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(run, rate, reporting);
  run(rate, reporting);
  return 0;
}
