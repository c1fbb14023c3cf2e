/// Writers of the samples of an offline run.
#pragma once

#include <memory>
#include <string>

#include "tools/offline_run.h"
#include "tools/output.h"
#include "tools/simulate_options.h"

namespace variator_sim {

class Simulation;

class SampleWriter {
 public:
  virtual ~SampleWriter() = default;

  /// Writes the samples in order, with the quantities of its columns' groups. Throws OutputError.
  virtual void write(const SampleBlock& block) = 0;
  /// Completes the output. Called once, after the last `write`. Throws OutputError.
  virtual void close() = 0;
};

/// Writes CSV to a file, or to standard output when `path` is empty. Throws OutputError.
std::unique_ptr<SampleWriter> makeCsvWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns);

/// Writes a bag with the topics of the groups: `state` and `joint_states`; `elements`, `inputs`,
/// `outputs`; `energy`; and, once, `scene`. Throws OutputError.
std::unique_ptr<SampleWriter> makeBagWriter(const std::string& path, const Simulation& simulation,
                                            const ColumnGroups& columns);

}  // namespace variator_sim
