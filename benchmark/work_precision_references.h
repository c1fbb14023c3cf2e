/// Reference solutions of the work-precision scenes, independent of the package's own solvers.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "peers/scene_list.h"

namespace variator_sim::benchmark {

struct Reference {
  std::vector<long double> state;  ///< phi, omega, epsilon at the end
  double difference = 0.0;         ///< between two methods, on the scale of the error
};

/// Integrates the hand-written scene in long double by two methods. Prints what it compares.
Reference makeReference(const SceneCase& scene);

/// By the scene's name. Throws std::runtime_error when the file cannot be read.
std::map<std::string, Reference> readReferences(const std::string& path);
void writeReferences(const std::string& path, const std::vector<SceneCase>& scenes,
                     const std::map<std::string, Reference>& references);

}  // namespace variator_sim::benchmark
