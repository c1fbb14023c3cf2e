/// Runs of one simulation for Python. It does not depend on Python, and is called with or without
/// the interpreter's lock.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tools/columns.h"
#include "tools/offline_run.h"
#include "tools/sensitivity.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/simulation.h"

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
  std::vector<ModeEvent> events;
};

/// Runs from the current time until the end, a stop or an interruption; `sensitivity`: adds its
/// derivatives to the samples, or null. Throws CommandFileError.
RunRows run(Simulation& simulation, const RunRequest& request, Sensitivity* sensitivity = nullptr);

}  // namespace variator_sim::python
