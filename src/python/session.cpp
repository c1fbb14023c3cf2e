#include "python/session.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>

#include "variator_sim/errors.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/nearest_name.h"
#include "variator_sim/overrides.h"

namespace variator_sim::python {
namespace {

/// Asks `keep_on` about twenty times a second while a simulation is moved.
class Watch {
 public:
  Watch(Simulation& simulation, const KeepOn& keep_on)
      : simulation_(simulation), keep_on_(keep_on) {
    simulation.interruptBy([this] { return isOver(); });
  }
  ~Watch() { simulation_.interruptBy({}); }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  bool isOver() {
    const Clock::time_point now = Clock::now();
    if (is_over_ || now < next_) return is_over_;
    next_ = now + std::chrono::milliseconds(50);
    return is_over_ = !keep_on_();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Simulation& simulation_;
  const KeepOn& keep_on_;
  Clock::time_point next_ = Clock::now() + std::chrono::milliseconds(50);
  bool is_over_ = false;
};

}  // namespace

Scene makeScene(ParameterTree tree, const Overrides& overrides, ComponentFactory& factory) {
  applyOwnOverrides(tree);
  for (const auto& [path, value] : overrides) setValue(tree, path, value);
  return readScene(tree, factory, nodeNames());
}

void Session::advanceTo(double time, const KeepOn& keep_on) {
  const Watch watch(simulation_, keep_on);
  simulation_.advanceTo(time);
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
  SampleBlock samples;
  samples.samples.reserve(OfflineRun::kBlockSize);
  Watch watch(simulation_, keep_on);
  for (bool more = true; more && !watch.isOver();) {
    more = run.advanceBlock(request.duration, samples);
    const double* quantities = samples.quantities.data();
    for (const Sample& sample : samples.samples) {
      rows.values.resize(rows.values.size() + maker.columnCount());
      maker.write(sample, quantities,
                  rows.values.data() + rows.values.size() - maker.columnCount());
      quantities += maker.quantityCount();
    }
  }
  return rows;
}

int Session::findInput(const std::string& topic) const {
  const std::vector<CommandInputSettings>& inputs = simulation_.scene().inputs;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i].topic == topic) return static_cast<int>(i);
  }
  std::vector<std::string> topics;
  topics.reserve(inputs.size());
  for (const CommandInputSettings& input : inputs) topics.push_back(input.topic);
  throw std::invalid_argument("unknown topic " + inQuotes(topic) + suggestName(topic, topics) +
                              "; " +
                              (topics.empty() ? "this scene takes no commands"
                                              : "the scene's topics are " + joinNames(topics)));
}

}  // namespace variator_sim::python
