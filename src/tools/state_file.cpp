#include "tools/state_file.h"

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
  writeOutput(
      path,
      "# The state of a motion: s, rad, rad/s, rad/s^2, N m, J. What is left out when it is read "
      "is\n"
      "# as the scene has it; without 'history' the motion starts there anew.\n" +
          toYaml(toTree(state, simulation.scene())));
}

}  // namespace variator_sim
