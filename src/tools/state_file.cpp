#include "tools/state_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "tools/sample_writer.h"
#include "variator_sim/io/yaml_text.h"
#include "variator_sim/io/yaml_tree.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

void readStateFile(const std::string& path, Simulation& simulation) {
  const ParameterTree tree = readYamlFile(path);
  MotionState present;
  if (!simulation.saveState(&present)) throw SceneError("", simulation.describeStatus());
  const Scene& scene = simulation.scene();
  try {
    const MotionState state = readMotionState(tree, scene, present);
    const std::string fault = simulation.setState(state, scene.initial.project);
    if (!fault.empty()) throw SceneError("", fault);
  } catch (const SceneError& error) {
    throw SceneError("", path + ": " + error.what());
  }
}

void writeStateFile(const std::string& path, const MotionState& state,
                    const Simulation& simulation) {
  const std::string text =
      "# The state of a motion: s, rad, rad/s, rad/s^2, N m, J. What is left out when it is read "
      "is\n"
      "# as the scene has it; without 'history' the motion starts there anew.\n" +
      toYaml(toTree(state, simulation.scene()));
  std::FILE* const file = std::fopen(path.c_str(), "w");
  bool is_good = file != nullptr && std::fputs(text.c_str(), file) >= 0;
  int error = errno;
  if (file != nullptr && std::fclose(file) != 0) {
    if (is_good) error = errno;
    is_good = false;
  }
  if (!is_good) throw OutputError(path + ": cannot be written: " + std::strerror(error));
}

}  // namespace variator_sim
