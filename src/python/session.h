/// One simulation as Python drives it. Knows nothing of Python: it is called with or without the
/// interpreter's lock.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tools/columns.h"
#include "tools/offline_run.h"
#include "variator_sim/parameter_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim::python {

using Overrides = std::vector<std::pair<std::string, ParameterTree>>;

/// Reads a scene's tree with these values in place of its own. Throws SceneError.
Scene makeScene(ParameterTree tree, const Overrides& overrides, ComponentFactory& factory);

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

/// Called about twenty times a second of wall time: false ends what is under way.
using KeepOn = std::function<bool()>;

class Session {
 public:
  explicit Session(Scene scene) : simulation_(std::move(scene)) {}
  explicit Session(Simulation simulation) : simulation_(std::move(simulation)) {}

  Simulation& simulation() { return simulation_; }
  const Simulation& simulation() const { return simulation_; }

  /// Moves the present to `time`. The motion may stop on the way.
  void advanceTo(double time, const KeepOn& keep_on);
  /// Runs from the present; ends where the motion stops. Throws CommandFileError.
  RunRows run(const RunRequest& request, const KeepOn& keep_on);

  /// Index of an input. Throws std::invalid_argument with the nearest topic.
  int findInput(const std::string& topic) const;

 private:
  Simulation simulation_;
};

}  // namespace variator_sim::python
