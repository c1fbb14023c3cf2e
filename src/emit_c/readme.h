/// The README beside an emitted program.
#pragma once

#include <string>

#include "variator_sim/scene.h"

namespace variator_sim {

/// Writes README.md: stepping the scene in a controller, the meaning of its numbers, its limits.
std::string writeReadme(const Scene& scene, const std::string& name, const std::string& title);
std::string writeMakefile(const std::string& name);

}  // namespace variator_sim
