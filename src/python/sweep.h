/// Runs of one simulation, and many runs of one scene with other values. It does not depend on
/// Python, and is called with or without the interpreter's lock.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/thrown.h"
#include "tools/columns.h"
#include "tools/sensitivity.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/parameter_tree.h"

namespace variator_sim::python {

using Overrides = std::vector<std::pair<std::string, ParameterTree>>;

/// Returns a scene's tree with these values in place of its own. Throws SceneError.
inline ParameterTree withOverrides(ParameterTree tree, const Overrides& overrides) {
  applyOwnOverrides(tree);
  for (const auto& [path, value] : overrides) setValue(tree, path, value);
  return tree;
}

/// The request for a run.
struct RunRequest {
  double duration;                           ///< s, from the current time
  double rate;                               ///< samples per second; unused when there are times
  std::optional<std::vector<double>> times;  ///< s, ascending
  std::vector<TimedCommand> commands;        ///< ascending
  ColumnGroups columns;
  bool until_rest;
};

/// Rows of samples, one after the other.
struct RunRows {
  std::vector<double> values;
  std::size_t ignored_commands = 0;  ///< those outside of the run
};

/// Runs from the current time until the end, a stop or an interruption; `sensitivity`: adds its
/// derivatives to the samples, or null. Throws CommandFileError.
inline RunRows run(Simulation& simulation, const RunRequest& request,
                   Sensitivity* sensitivity = nullptr) {
  const double begin = simulation.time();
  const double end = begin + request.duration;
  OfflineRun offline(simulation,
                     request.times ? SampleTimes::at(*request.times)
                                   : SampleTimes::atRate(request.rate, begin, end),
                     resolveCommands(request.commands, simulation.scene(), "commands"), end);
  offline.observe(request.columns.quantities);
  offline.differentiate(sensitivity);
  if (request.until_rest) offline.endAtRest();
  RunRows rows;
  rows.ignored_commands = offline.ignoredCount() + offline.pastCount();
  const Columns columns(simulation, request.columns);
  SampleBlock samples;
  samples.samples.reserve(OfflineRun::kBlockSize);
  for (bool more = true; more && !Interruption::isWanted();) {
    more = offline.advanceBlock(kNever, samples);
    columns.append(samples, &rows.values);
  }
  return rows;
}

/// Machine code of some runs, never moved, which all rows share. A scene in which two numbers
/// happen to be equal has other formulas than one in which they differ, so there are a few.
class CodeOfRows {
 public:
  explicit CodeOfRows(bool compiles) : compiles_(compiles) {}
  void giveTo(Simulation& simulation) {
    const std::size_t ready = ready_;
    for (std::size_t i = 0; i < ready; ++i) {
      if (simulation.shareMachineCode(*owners_[i])) return;
    }
    if (ready == kMost) return;
    // Rows that start during a compilation are interpreted.
    const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() || tried_ == kMost || ready_ != ready) return;
    ++tried_;
    auto owner = std::make_unique<Simulation>(simulation.scene(), simulation);
    const bool always = owner->scene().solver.machine_code == MachineCode::kAlways;
    if (!owner->loadMachineCode(compiles_ || always)) return;
    simulation.shareMachineCode(*owner);
    owners_[ready] = std::move(owner);
    ++ready_;
  }

 private:
  static constexpr std::size_t kMost = 4;
  const bool compiles_;
  std::mutex mutex_;
  std::size_t tried_ = 0;
  std::array<std::unique_ptr<Simulation>, kMost> owners_;
  std::atomic<std::size_t> ready_{0};
};

/// The state that the threads of a sweep share: a thread that a plugin blocks may outlive it.
struct Sweep {
  const ParameterTree tree;              ///< with the overrides of all rows
  const std::vector<std::string> paths;  ///< keys whose values differ
  const RunRequest run;
  const std::shared_ptr<ComponentFactory> factory;
  CodeOfRows code;
  std::atomic<bool> is_cancelled{false};  ///< ends the runs under way
};

/// One run of a sweep.
struct SweepRow {
  std::vector<double> values;  ///< of RunRows
  std::string reason;          ///< "" or why it failed
};

/// Makes the runs of a sweep, for one thread; reads only changed values if that suffices.
class RowRunner {
 public:
  explicit RowRunner(std::shared_ptr<Sweep> sweep)
      : sweep_(std::move(sweep)), tree_(sweep_->tree) {}

  /// Runs with one value a path. The result depends neither on other rows nor on other threads.
  /// Throws what is no fault of the row.
  SweepRow run(const std::vector<double>& values) {
    const Interruption interruption([this] { return sweep_->is_cancelled.load(); });
    SweepRow row;
    try {
      Simulation simulation = make(values);
      simulation.trackEnergy(sweep_->run.columns.energy);
      row.values = python::run(simulation, sweep_->run).values;
      row.reason = simulation.describeStatus();
    } catch (const std::bad_alloc&) {
      throw;  // no fault of the row
    } catch (...) {
      row.reason = describeThrown();
    }
    return row;
  }

 private:
  /// Runs after which the formulas are read anew, since their graph may grow with every run.
  static constexpr int kUses = 64;

  Simulation make(const std::vector<double>& values) {
    Scene scene = read(values);
    if (!keeps_formulas_) {
      Simulation simulation(std::move(scene));
      sweep_->code.giveTo(simulation);
      return simulation;
    }
    if (like_ == nullptr) like_ = std::make_unique<Simulation>(scene);
    sweep_->code.giveTo(*like_);
    return Simulation(std::move(scene), *like_);
  }

  Scene read(const std::vector<double>& values) {
    ParameterTree tree = tree_;
    for (std::size_t i = 0; i < values.size(); ++i) {
      setValue(tree, sweep_->paths[i], ParameterTree::real(values[i]));
    }
    if (uses_left_ > 0) {
      --uses_left_;
      Scene scene = model_;
      rereadNumbers(tree, nodeNames(), &scene);
      return scene;
    }
    Scene scene = readScene(tree, *sweep_->factory, nodeNames());
    if (!is_known_) inspect(scene);
    if (keeps_formulas_) {
      model_ = scene;
      uses_left_ = kUses;
      like_.reset();
    }
    return scene;
  }

  void inspect(const Scene& scene) {
    is_known_ = true;
    for (const Law* law : scene.laws()) {
      if (law->callsOpaqueFunction()) return;  // its gradients are checked in each row
    }
    const std::vector<std::string>& paths = sweep_->paths;
    keeps_formulas_ = std::all_of(paths.begin(), paths.end(), [&](const std::string& path) {
      return isOutsideFormulas(path, scene);
    });
    // One check suffices for all rows.
    setValue(tree_, "verify_derivatives", ParameterTree::boolean(false));
  }

  const std::shared_ptr<Sweep> sweep_;
  ParameterTree tree_;
  bool is_known_ = false;
  bool keeps_formulas_ = false;
  Scene model_;
  /// Simulation of the first row with these formulas.
  std::unique_ptr<Simulation> like_;
  int uses_left_ = 0;
};

}  // namespace variator_sim::python
