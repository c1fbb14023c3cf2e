/// Runs of one simulation, and many runs of one scene with other values, on all cores. It does not
/// depend on Python, and is called with or without the interpreter's lock.
#pragma once

#include <memory>
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

/// One number of a run, from one of its columns.
struct Metric {
  std::string kind;        ///< "final", "min", "max", "mean", "integral" or "settling"
  std::size_t column = 0;  ///< of RunRequest::columns
  /// For "settling": half width of the settled band, as a part of the change, end minus start.
  double band = 0.02;
};

/// Evaluates `rows` of `width` values, the time first; NaN without rows. "mean" and "integral":
/// over time, by trapezoids. "settling": the first sample from which on the value stays within
/// the band around its last one, s since the start.
double calcMetric(const Metric& metric, const std::vector<double>& rows, std::size_t width);

struct SweepRequest {
  ParameterTree tree;
  Overrides overrides;             ///< the same for all runs
  std::vector<std::string> paths;  ///< keys whose values differ
  RunRequest run;
  std::vector<Metric> metrics;
  /// Compiles formulas without machine code in the cache before the runs.
  bool compiles = false;
};

/// One run of a sweep.
struct SweepRow {
  std::vector<double> metrics;  ///< NaN where the run failed
  std::string reason;           ///< "" or why it failed
};

/// Runs every row of `values` (one value a path) on `threads` threads, or on as many as can be
/// started; an Interruption of the calling thread ends all of them: a thread that does not end
/// soon, as a plugin blocks it, is left behind, and Interrupted is thrown. A row's result depends
/// neither on the other rows nor on the number of threads. Any exception of a thread other than a
/// row's fault ends the others and is rethrown.
std::vector<SweepRow> runSweep(SweepRequest request, std::vector<std::vector<double>> values,
                               int threads, std::shared_ptr<ComponentFactory> factory);

}  // namespace variator_sim::python
