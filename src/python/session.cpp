#include "python/session.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <stdexcept>

#include "variator_sim/errors.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/overrides.h"

namespace variator_sim::python {
namespace {

/// A span of simulated time that takes about a twentieth of a second.
class BlockSpan {
 public:
  explicit BlockSpan(double whole) : span_(std::max(whole / 64.0, kShortest)) {}
  double span() const { return span_; }
  void begin() { start_ = Clock::now(); }
  void end() {
    const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
    if (seconds < 0.01) span_ *= 2.0;
    if (seconds > 0.1) span_ *= 0.5;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr double kShortest = 0.1;  // s; a step of a controller is no block to cut
  double span_;
  Clock::time_point start_;
};

}  // namespace

Scene makeScene(ParameterTree tree, const Overrides& overrides, ComponentFactory& factory) {
  applyOwnOverrides(tree);
  for (const auto& [path, value] : overrides) setValue(tree, path, value);
  return readScene(tree, factory, nodeNames());
}

void Session::advanceTo(double time, const KeepOn& keep_on) {
  // Cuts change no bit of a motion.
  BlockSpan block(time - simulation_.time());
  while (simulation_.time() < time) {
    block.begin();
    const double end = std::min(time, simulation_.time() + block.span());
    if (!simulation_.advanceTo(end > simulation_.time() ? end : time).ok()) return;
    block.end();
    if (simulation_.time() < time && !keep_on()) return;
  }
}

RunRows Session::run(const RunRequest& request, const KeepOn& keep_on) {
  const double begin = simulation_.time();
  const double end = begin + request.duration;
  OfflineRun run(simulation_,
                 request.has_times ? SampleTimes::at(request.times)
                                   : SampleTimes::atRate(request.rate, begin, end),
                 resolveCommands(request.commands, simulation_.scene(), "commands"), end);
  run.observe(request.columns.quantities);
  if (request.until_rest) run.endAtRest();
  RunRows rows;
  rows.ignored_commands = run.ignoredCount() + run.pastCount();
  const RowMaker maker(simulation_, request.columns);
  const volatile std::sig_atomic_t never = 0;
  SampleBlock samples;
  samples.samples.reserve(OfflineRun::kBlockSize);
  BlockSpan block(request.duration);
  for (bool more = true; more;) {
    block.begin();
    more = run.advanceBlock(block.span(), &never, samples);
    block.end();
    const double* quantities = samples.quantities.data();
    for (const Sample& sample : samples.samples) {
      rows.values.resize(rows.values.size() + maker.columnCount());
      maker.write(sample, quantities,
                  rows.values.data() + rows.values.size() - maker.columnCount());
      quantities += maker.quantityCount();
    }
    if (more && !keep_on()) break;
  }
  return rows;
}

}  // namespace variator_sim::python
