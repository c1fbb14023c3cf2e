/// A scene as a functional mock-up unit (FMU) for co-simulation.
#pragma once

#include <string>

#include "variator_sim/simulation.h"

namespace variator_sim {

/// Describes the FMU of `simulation`, at time 0, as JSON: its C source, variables and units, from
/// which python/variator_sim/fmu_archive.py makes the archive. `version` is 2 or 3, `name` one of
/// C, `title` the scene's name in descriptions. Throws SceneError, with the element and the reason,
/// for elements that cannot be written.
std::string describeFmu(Simulation& simulation, int version, const std::string& name,
                        const std::string& title);

}  // namespace variator_sim
