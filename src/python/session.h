/// One simulation as Python drives it. Knows nothing of Python: it is called with or without the
/// interpreter's lock.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tools/columns.h"
#include "tools/offline_run.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim::python {

using Overrides = std::vector<std::pair<std::string, ParameterTree>>;

/// A scene's tree with these values in place of its own. Throws SceneError.
ParameterTree withOverrides(ParameterTree tree, const Overrides& overrides);

/// What a run is asked for.
struct RunRequest {
  double duration = 0.0;  ///< s, from the present
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

/// Runs from the present; ends where the motion stops or is interrupted. Throws CommandFileError.
RunRows run(Simulation& simulation, const RunRequest& request);

}  // namespace variator_sim::python
