/// `simulate --linearize` and `simulate --trim`.
#pragma once

#include <csignal>
#include <vector>

#include "tools/offline_run.h"
#include "tools/simulate_options.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// Brings `simulation` to where `--at` says, writes its linear model and prints a report. Throws
/// SceneError, UsageError, OutputError. False when the motion stops on the way, or comes to no
/// rest.
bool runLinearize(Simulation& simulation, const std::vector<ResolvedCommand>& commands,
                  const SimulateOptions& options, const volatile std::sig_atomic_t* interrupted);

/// Writes the steady state. False when there is none.
bool runTrim(const Scene& scene, const SimulateOptions& options);

}  // namespace variator_sim
