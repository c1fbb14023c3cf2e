/// A scene as a program of its own: C99 that needs the library of mathematics and nothing else.
#pragma once

#include <string>

#include "variator_sim/simulation.h"

namespace variator_sim {

/// The files of an emitted scene, but for their names: NAME.h, NAME.c, main.c, README.md, Makefile.
struct EmittedScene {
  std::string name;
  std::string header;
  std::string source;
  std::string main;
  std::string readme;
  std::string makefile;
};

/// The file's name without folder and ending, as a name of C: "3 shafts.yaml" is "scene_3_shafts".
std::string nameForC(const std::string& scene_path);

/// `simulation`, at time 0, as C; `title` is what comments call the scene. Throws SceneError, with
/// the element and the reason, for what cannot be written.
EmittedScene emitScene(Simulation& simulation, const std::string& name, const std::string& title);

/// Into files of `directory`, which is made where it is missing. Each ends with a sum of what
/// stands before it; a file that is there and does not is a user's, and refused before any is
/// written. Throws std::runtime_error.
void writeEmittedScene(const EmittedScene& scene, const std::string& directory);

}  // namespace variator_sim
