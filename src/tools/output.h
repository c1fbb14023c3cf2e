/// Files that `simulate` writes beside its samples, and states of motions (YAML).
#pragma once

#include <string>

#include "variator_sim/motion_state.h"

namespace variator_sim {

class Simulation;

/// Thrown if an output cannot be written; what() names it and the system's reason.
class OutputError : public Error {
 public:
  using Error::Error;
};

/// Thrown if the reader of the output has gone (`simulate ... | head`), so that the rest is
/// useless.
class OutputClosed : public OutputError {
 public:
  using OutputError::OutputError;
};

/// Tells the user of something, on standard error.
void tell(const std::string& message);

/// Throws OutputClosed or OutputError for the output `name`, whose writing has failed with errno.
[[noreturn]] void failedToWrite(const std::string& name);

/// Writes a text to a file atomically, or to standard output when `path` is empty. Throws
/// OutputError.
void writeOutput(const std::string& path, const std::string& text);

/// Throws OutputError if a file there could not be written as a whole: before long work for it.
void checkWritable(const std::string& path);

/// Runs a file of the package's Python folder, which lies beside this program, with one argument
/// and `input` on its standard input. Returns its standard output; throws OutputError with it, the
/// reason, if it fails. An Interruption ends it, and Interrupted is thrown, unless it has succeeded
/// meanwhile.
std::string runPythonFile(const std::string& name, std::string argument, const std::string& input);

/// Continues the simulation from the state in a file; missing values are the simulation's.
/// Inconsistent values are projected if the scene's `initial/project` allows it. Throws SceneError.
void readStateFile(const std::string& path, Simulation& simulation);

/// Throws OutputError.
void writeStateFile(const std::string& path, const MotionState& state,
                    const Simulation& simulation);

}  // namespace variator_sim
