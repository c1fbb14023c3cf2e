/// The figures of a run that `simulate --stats` prints.
#pragma once

#include <cstdint>

#include "variator_sim/simulation.h"

namespace variator_sim {

/// Wall time, s, of each part of the run.
struct WallTimes {
  double simulation = 0.0;  ///< stepping and samples
  double sampling = 0.0;    ///< the samples' part of it
  double output = 0.0;      ///< formatting and writing
};

/// Prints to standard error. `tracks_energy`: the energies were integrated.
void printStatistics(Simulation& simulation, bool tracks_energy, const WallTimes& wall,
                     std::uint64_t samples);

}  // namespace variator_sim
