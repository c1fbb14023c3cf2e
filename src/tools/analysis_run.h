/// `simulate --linearize` and `simulate --trim`.
#pragma once

#include <vector>

#include "tools/offline_run.h"
#include "tools/simulate_options.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// Brings `simulation` to the point of `--at`, writes its linear model and prints a report. Throws
/// SceneError, UsageError, OutputError. Returns false when the motion stops on the way, comes to no
/// rest or is interrupted (Interruption).
bool runLinearize(Simulation& simulation, const std::vector<ResolvedCommand>& commands,
                  const SimulateOptions& options);

/// Writes the steady state. Returns false when there is none.
bool runTrim(const Scene& scene, const SimulateOptions& options);

}  // namespace variator_sim
