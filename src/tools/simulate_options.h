/// The command line of `simulate`.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "tools/columns.h"
#include "variator_sim/errors.h"

namespace variator_sim {

/// Thrown for an invalid command line; what() names the word and the allowed values.
class UsageError : public Error {
 public:
  using Error::Error;
};

struct SimulateOptions {
  bool help = false;
  bool explain = false;  ///< print the equations instead of running
  bool latex = false;    ///< of them
  std::string scene_path;
  std::vector<std::string> overrides;  ///< of the scene's values: PATH=VALUE, in order
  double duration = 0.0;               ///< s
  double rate = 100.0;                 ///< samples per second; unused when `times` are given
  std::vector<double> times;  ///< s, ascending, the last one at most `duration`; empty: rate
  bool has_duration = false;
  bool until_rest = false;      ///< the run ends sooner, when the motion comes to rest
  std::string from_state_path;  ///< empty: the scene's start
  std::string save_state_path;  ///< empty: nowhere
  bool has_save_time = false;
  double save_time = 0.0;     ///< s; the end when not given
  std::string commands_path;  ///< empty: no commands
  std::string events_path;    ///< of changes of modes; empty: nowhere
  std::string output_path;    ///< empty: standard output
  ColumnGroups columns;
  bool estimate_errors = false;
  bool check_minimum = false;            ///< compare Z with the least one at each sample
  std::string curves_path;               ///< of it: where Z along the admissible directions goes
  std::vector<std::string> sensitivity;  ///< paths that samples are differentiated by
  bool compare_principles = false;       ///< run under all principles
  bool stats = false;
  bool linearize = false;         ///< write a linear model instead of running
  bool full = false;              ///< of it: all states, and not only coordinates on psi = 0
  std::string at = "rest";        ///< the point: a time, "rest", a file or a state
  bool trim = false;              ///< write a steady state instead of running
  bool accelerating = false;      ///< of it: accelerations in constant ratios
  std::vector<std::string> fix;   ///< of it: NAME=VALUE
  std::vector<std::string> free;  ///< of it: NAME or NAME=START
  bool compile = false;           ///< only fill the cache of machine code
  std::string emit_fmu_path;      ///< file: only write the scene as an FMU; empty: none
  int fmi = 3;                    ///< version of FMI
  std::string emit_c_path;        ///< folder: only write the scene as C; empty: none
};

/// Reads the words after the program's name. Throws UsageError.
SimulateOptions parseSimulateOptions(const std::vector<std::string>& words);

/// Returns the end of a path from its last dot on.
inline std::string endingOf(const std::string& path) {
  return path.substr(std::min(path.rfind('.'), path.size()));
}

/// The text of --help.
extern const char* const kSimulateHelp;

}  // namespace variator_sim
