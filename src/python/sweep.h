/// Runs of one simulation, and many runs of one scene with other values. It does not depend on
/// Python, and is called with or without the interpreter's lock.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "tools/columns.h"
#include "tools/sensitivity.h"

namespace variator_sim::python {

using Overrides = std::vector<std::pair<std::string, ParameterTree>>;

/// Returns a scene's tree with these values in place of its own. Throws SceneError.
ParameterTree withOverrides(ParameterTree tree, const Overrides& overrides);

/// The request for a run.
struct RunRequest {
  double duration = 0.0;  ///< s, from the current time
  double rate = 100.0;    ///< samples per second; unused when there are times
  bool has_times = false;
  std::vector<double> times;           ///< s, ascending
  std::vector<TimedCommand> commands;  ///< ascending
  ColumnGroups columns;
  bool until_rest = false;
};

/// Rows of samples, one after the other.
struct RunRows {
  std::vector<double> values;
  std::size_t ignored_commands = 0;  ///< those outside of the run
};

/// Runs from the current time until the end, a stop or an interruption; `sensitivity`: adds its
/// derivatives to the samples, or null. Throws CommandFileError.
RunRows run(Simulation& simulation, const RunRequest& request, Sensitivity* sensitivity = nullptr);

/// Machine code of some runs, never moved, which all rows share. A scene in which two numbers
/// happen to be equal has other formulas than one in which they differ, so there are a few.
class CodeOfRows {
 public:
  explicit CodeOfRows(bool compiles) : compiles_(compiles) {}
  void giveTo(Simulation& simulation);

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
  SweepRow run(const std::vector<double>& values);

 private:
  /// Runs after which the formulas are read anew, since their graph may grow with every run.
  static constexpr int kUses = 64;

  Simulation make(const std::vector<double>& values);
  Scene read(const std::vector<double>& values);
  void inspect(const Scene& scene);

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
