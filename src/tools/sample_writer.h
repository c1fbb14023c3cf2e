/// Writers of the samples of an offline run, and of other outputs.
#pragma once

#include <memory>
#include <string>

#include "tools/offline_run.h"
#include "tools/simulate_options.h"
#include "variator_sim/errors.h"

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

class SampleWriter {
 public:
  virtual ~SampleWriter() = default;
  SampleWriter(const SampleWriter&) = delete;
  SampleWriter& operator=(const SampleWriter&) = delete;

  /// Writes the samples in order, with the quantities of its columns' groups. Throws OutputError.
  virtual void write(const SampleBlock& block) = 0;
  /// Completes the output. Called once, after the last `write`. Throws OutputError.
  virtual void close() = 0;

 protected:
  SampleWriter() = default;
};

/// Writes CSV to a file, or to standard output when `path` is empty. Throws OutputError.
std::unique_ptr<SampleWriter> makeCsvWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns);

/// Writes a text to a file atomically, or to standard output when `path` is empty. Throws
/// OutputError.
void writeOutput(const std::string& path, const std::string& text);

/// Writes a bag with the topics of the groups: `state` and `joint_states`; `elements`, `inputs`,
/// `outputs`; `energy`; and, once, `scene`. Throws OutputError.
std::unique_ptr<SampleWriter> makeBagWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns);

}  // namespace variator_sim
