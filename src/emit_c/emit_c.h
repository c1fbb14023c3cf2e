/// A scene as a standalone program: C99 that needs only the library of mathematics.
#pragma once

#include <string>

#include "variator_sim/simulation.h"

namespace variator_sim {

/// The contents of an emitted scene's files: NAME.h, NAME.c, main.c, README.md, Makefile.
struct EmittedScene {
  std::string name;
  std::string header;
  std::string source;
  std::string main;
  std::string readme;
  std::string makefile;
};

/// Returns the file's base name as a name of C: "3 shafts.yaml" is "scene_3_shafts".
std::string nameForC(const std::string& scene_path);

/// Writes `simulation`, at time 0, as C; `title` is the scene's name in comments. Throws
/// SceneError, with the element and the reason, for elements that cannot be written.
EmittedScene emitScene(Simulation& simulation, const std::string& name, const std::string& title);

/// Writes files to `directory`, which is made if it is missing. Each file ends with a checksum of
/// its text; an existing file without it is a user's, and rejected before any file is written.
/// Throws std::runtime_error.
void writeEmittedScene(const EmittedScene& scene, const std::string& directory);

}  // namespace variator_sim
