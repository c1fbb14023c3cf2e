/// Drives a Simulation through its commands and sample times, block by block.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tools/rest_watch.h"
#include "tools/sample_times.h"
#include "variator_sim/io/command_file.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/quantity_group.h"
#include "variator_sim/sample.h"
#include "variator_sim/status.h"

namespace variator_sim {

class Sensitivity;
class Simulation;
struct Scene;

/// A command whose topic has been found in the scene.
struct ResolvedCommand {
  double time;   ///< s
  int input;     ///< index into Scene::inputs
  double value;  ///< the input's own unit
  int line;      ///< where it stands in its file
};

/// Finds each command's input by its topic. Throws CommandFileError with the nearest topic.
std::vector<ResolvedCommand> resolveCommands(const std::vector<TimedCommand>& commands,
                                             const Scene& scene, const std::string& path);

/// Returns warnings about the run so far: crude fixed steps, clamped commands, reactions that feed
/// or drain the machine.
std::vector<std::string> describeDoubts(const Simulation& simulation);

/// Returns events as a CSV.
std::string writeEvents(const std::vector<ModeEvent>& events, const Scene& scene);

/// Samples in order, and their quantities.
struct SampleBlock {
  std::vector<Sample> samples;
  std::vector<double> quantities;  ///< sample after sample, within it group after group
};

class OfflineRun {
 public:
  /// Runs from the simulation's current time to `end`. `commands` must be sorted by time; the run
  /// ignores commands outside of it.
  OfflineRun(Simulation& simulation, SampleTimes times, std::vector<ResolvedCommand> commands,
             double end);

  const std::vector<ResolvedCommand>& commands() const { return commands_; }

  /// Saves the state at `time` and continues from it; saves the end if that comes first.
  void saveStateAt(double time) { save_time_ = time; }
  /// Saves the state now, unless it has been saved.
  void saveState();
  /// Returns nullptr when the motion stopped before.
  const MotionState* savedState() const { return has_state_ ? &state_ : nullptr; }

  /// Ends the run once the motion has come to rest, after the last command.
  void endAtRest() { rest_.begin(); }
  const RestWatch& rest() const { return rest_; }

  /// The changes of modes and events of the scene so far.
  const std::vector<ModeEvent>& events() const { return events_; }
  /// Calls `look` at each sample, where the simulation stands.
  void lookAt(std::function<void(const Sample&)> look) { look_ = std::move(look); }
  /// Adds derivatives to samples, behind the quantities; they have to outlive the run.
  void differentiate(Sensitivity* by) { sensitivity_ = by; }
  /// Adds the quantities of these groups to samples.
  void observe(const std::vector<QuantityGroup>& groups);

  /// Advances until `block` (emptied first) holds kBlockSize samples, the current time has moved by
  /// `span` seconds, an Interruption is requested, the end is reached or the motion stops. Returns
  /// false when the run is complete.
  bool advanceBlock(double span, SampleBlock& block);

  /// Number of commands rejected because they are NaN or infinite, and the line of the first.
  std::uint64_t refusedCount() const { return refused_count_; }
  int firstRefusedLine() const { return first_refused_line_; }
  /// Number of commands outside of the run.
  std::size_t ignoredCount() const { return ignored_count_; }
  std::size_t pastCount() const { return past_count_; }

  /// Wall time spent on samples so far, s; measured only after `measureSampling`, as a stopwatch
  /// costs a tenth of a sample.
  void measureSampling() { measures_sampling_ = true; }
  double samplingSeconds() const { return sampling_seconds_; }

  static constexpr std::size_t kBlockSize = 256;

 private:
  bool reach(double time);
  void takeEvents();
  void applyCommands();
  /// Next instant due beside commands and samples.
  double nextEvent() const;
  void serveEvents();
  void takeSample(SampleBlock& block);
  void addSample(SampleBlock& block);

  Simulation& simulation_;
  SampleTimes times_;
  std::vector<ResolvedCommand> commands_;
  double end_;
  double save_time_;
  bool has_state_ = false;
  MotionState state_;
  RestWatch rest_;
  std::function<void(const Sample&)> look_;
  std::vector<QuantityGroup> groups_;
  Sensitivity* sensitivity_ = nullptr;
  std::vector<ModeEvent> events_;
  std::size_t next_command_ = 0;
  std::size_t ignored_count_ = 0;
  std::size_t past_count_ = 0;
  std::uint64_t refused_count_ = 0;
  int first_refused_line_ = 0;
  bool measures_sampling_ = false;
  double sampling_seconds_ = 0.0;
};

}  // namespace variator_sim
