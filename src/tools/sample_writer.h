/// Where the samples of an offline run go, and other outputs of the tools.
#pragma once

#include <memory>
#include <string>

#include "tools/offline_run.h"
#include "tools/simulate_options.h"
#include "variator_sim/errors.h"

namespace variator_sim {

class Simulation;

/// The output cannot be written; what() names it and the system's reason.
class OutputError : public Error {
 public:
  using Error::Error;
};

/// Whoever read our output has gone (`simulate ... | head`): nobody wants the rest.
class OutputClosed : public OutputError {
 public:
  using OutputError::OutputError;
};

class SampleWriter {
 public:
  virtual ~SampleWriter() = default;
  SampleWriter(const SampleWriter&) = delete;
  SampleWriter& operator=(const SampleWriter&) = delete;

  /// Writes the samples, in order, with the quantities of the groups that its columns have. Throws
  /// OutputError.
  virtual void write(const SampleBlock& block) = 0;
  /// Completes the output. Called once, after the last `write`. Throws OutputError.
  virtual void close() = 0;

 protected:
  SampleWriter() = default;
};

/// CSV into a file, or to standard output when `path` is empty. Throws OutputError.
std::unique_ptr<SampleWriter> makeCsvWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns);

/// Writes a text into a file, whole or not at all, or to standard output when `path` is empty.
/// Throws OutputError.
void writeOutput(const std::string& path, const std::string& text);

/// A bag with the topics of the groups: `state` and `joint_states`; `elements`, `inputs`,
/// `outputs`; `energy`; and, once, `scene`. Throws OutputError.
std::unique_ptr<SampleWriter> makeBagWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns);

}  // namespace variator_sim
