/// What stands beside an emitted program.
#pragma once

#include <string>

#include "variator_sim/scene.h"

namespace variator_sim {

/// README.md: how to step the scene in a controller, what its numbers mean and what it cannot do.
std::string writeReadme(const Scene& scene, const std::string& name, const std::string& title);
std::string writeMakefile(const std::string& name);

}  // namespace variator_sim
