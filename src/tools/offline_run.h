/// Drives a Simulation through its commands and sample times, block by block.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/io/command_file.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

class Sensitivity;

/// Finds each command's input by its topic. Throws CommandFileError with the nearest topic.
std::vector<TimedCommand> resolveCommands(std::vector<TimedCommand> commands, const Scene& scene,
                                          const std::string& path);

/// Returns warnings about the run so far: crude fixed steps, clamped commands, reactions that feed
/// or drain the machine.
std::vector<std::string> describeDoubts(const Simulation& simulation);

/// Takes the changes of modes and events of the scene that wait, and returns them as a CSV.
std::string writeEvents(Simulation& simulation);

/// Samples in order, and their quantities.
struct SampleBlock {
  std::vector<Sample> samples;
  std::vector<double> quantities;  ///< sample after sample, within it group after group
};

constexpr double kNever = std::numeric_limits<double>::infinity();

/// A walk over ascending instants; it never holds a rate's instants in memory.
class SampleTimes {
 public:
  /// `begin`, then k / rate for all whole k between `begin` and `end`, then `end` itself.
  static SampleTimes atRate(double rate, double begin, double end) {
    SampleTimes times;
    times.rate_ = rate;
    times.end_ = end;
    times.index_ = static_cast<std::uint64_t>(begin * rate);
    while (static_cast<double>(times.index_) / rate <= begin) ++times.index_;
    times.current_ = begin;
    return times;
  }
  /// Uses the given instants, which must be ascending.
  static SampleTimes at(std::vector<double> instants) {
    SampleTimes times;
    times.instants_ = std::move(instants);
    times.takeInstant();
    return times;
  }

  /// Ends the run sooner, at `end`; later instants are not sampled. A rate samples the end.
  void endAt(double end) {
    end_ = end;
    if (current_ <= end) return;
    current_ = rate_ > 0.0 ? end : kNever;
    instants_.clear();
  }

  /// Next instant to sample; infinity after the last.
  double current() const { return current_; }
  void next() {
    if (rate_ == 0.0) {
      takeInstant();
    } else if (current_ >= end_) {
      current_ = kNever;
    } else {
      // A division: k / 100 is the double nearest to the decimal that a user would write, k * 0.01
      // is not.
      current_ = std::min(static_cast<double>(index_++) / rate_, end_);
    }
  }

 private:
  SampleTimes() = default;

  void takeInstant() { current_ = index_ < instants_.size() ? instants_[index_++] : kNever; }

  double rate_ = 0.0;
  double end_ = 0.0;
  std::vector<double> instants_;
  std::uint64_t index_ = 0;
  double current_ = kNever;
};

/// A motion is steady where every shaft has
///     |epsilon| <= kSteady (|omega| + 1 rad/s) / s,
/// and each state z of the scene that something reads |z'| <= kSteady (|z| + 1) / s between looks,
/// and at rest when neither a command nor a timeout is to come and it sleeps, or has been steady
/// for kStaying. Looked at every kInterval, which changes no bit of it.
class RestWatch {
 public:
  static constexpr double kSteady = 1e-6;
  static constexpr double kStaying = 1.0;    // s
  static constexpr double kInterval = 0.05;  // s

  void begin() { next_ = 0.0; }
  double nextLook() const { return next_; }
  bool isReached() const { return is_reached_; }
  /// The first look since which it has been steady, s.
  double since() const { return since_; }

  /// True when the motion is at rest.
  bool look(Simulation& simulation, bool is_last_command) {
    const double now = simulation.time();
    next_ = now + kInterval;
    if (!isSteady(simulation)) {
      since_ = kNever;
      return false;
    }
    since_ = std::min(since_, now);
    is_reached_ = is_last_command && simulation.nextTimeout() == kNever &&
                  (simulation.isSleeping() || now - since_ >= kStaying);
    if (is_reached_) next_ = kNever;
    return is_reached_;
  }

 private:
  bool isSteady(Simulation& simulation) {
    states_.resize(simulation.scene().states.size(), kNever);
    const std::vector<double> before = states_;
    simulation.calcQuantities(QuantityGroup::kStates, states_.data());
    const Sample& sample = simulation.sample();
    if (!simulation.status().ok()) return false;
    for (int i = 0; i < simulation.scene().shaftCount(); ++i) {
      const double allowed = kSteady * (std::abs(sample.velocity[i]) + 1.0);
      if (!(std::abs(sample.acceleration[i]) <= allowed)) return false;
    }
    for (std::size_t i = 0; i < states_.size(); ++i) {
      const double allowed = kSteady * kInterval * (std::abs(states_[i]) + 1.0);
      const bool is_steady = std::abs(states_[i] - before[i]) <= allowed;
      if (simulation.scene().states[i].is_read && !is_steady) return false;
    }
    return true;
  }

  std::vector<double> states_;  ///< at the last look
  double next_ = kNever;
  double since_ = kNever;
  bool is_reached_ = false;
};

class OfflineRun {
 public:
  /// Runs from the simulation's current time to `end`. `commands` must be sorted by time; the run
  /// ignores commands outside of it.
  OfflineRun(Simulation& simulation, SampleTimes times, std::vector<TimedCommand> commands,
             double end);

  const std::vector<TimedCommand>& commands() const { return commands_; }

  /// Saves the state at `time` and continues from it; saves the end if that comes first.
  void saveStateAt(double time) { save_time_ = time; }
  /// Saves the state now, unless it has been saved.
  void saveState();
  /// Returns nullptr when the motion stopped before.
  const MotionState* savedState() const { return has_state_ ? &state_ : nullptr; }

  /// Ends the run once the motion has come to rest, after the last command.
  void endAtRest() { rest_.begin(); }
  const RestWatch& rest() const { return rest_; }

  /// Calls `look` at each sample, where the simulation stands.
  void lookAt(std::function<void(const Sample&)> look) { look_ = std::move(look); }
  /// Adds derivatives to samples, behind the quantities; they have to outlive the run.
  void differentiate(Sensitivity* by) { sensitivity_ = by; }
  /// Adds the quantities of these groups to samples.
  void observe(const std::vector<QuantityGroup>& groups) { groups_ = groups; }

  /// Advances until `block` (emptied first) holds kBlockSize samples, the current time has moved by
  /// `span` seconds, an Interruption is requested, the end is reached or the motion stops. Returns
  /// false when the run is complete.
  bool advanceBlock(double span, SampleBlock& block);

  /// Number of commands rejected because they are NaN or infinite, and the first.
  std::uint64_t refusedCount() const { return refused_count_; }
  const TimedCommand& firstRefused() const { return first_refused_; }
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
  void applyCommands();
  /// Looks for rest and saves the state where these are due.
  void serveEvents();
  void takeSample(SampleBlock& block);
  void addSample(SampleBlock& block);

  Simulation& simulation_;
  SampleTimes times_;
  std::vector<TimedCommand> commands_;
  double end_;
  double save_time_ = kNever;
  bool has_state_ = false;
  MotionState state_;
  RestWatch rest_;
  std::function<void(const Sample&)> look_;
  std::vector<QuantityGroup> groups_;
  Sensitivity* sensitivity_ = nullptr;
  std::size_t next_command_ = 0;
  std::size_t ignored_count_ = 0;
  std::size_t past_count_ = 0;
  std::uint64_t refused_count_ = 0;
  TimedCommand first_refused_{};
  bool measures_sampling_ = false;
  double sampling_seconds_ = 0.0;
};

}  // namespace variator_sim
