#include "ros/server_from_parameters.h"

#include <stdexcept>
#include <string>

#include "ros/plugin_loader.h"
#include "ros/simulation_server.h"
#include "ros/xmlrpc_tree.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/node_names.h"
#include "variator_sim/scene.h"

namespace variator_sim {
namespace {

ParameterTree readParameters(const ros::NodeHandle& private_handle) {
  XmlRpc::XmlRpcValue value;
  if (!private_handle.getParam(private_handle.getNamespace(), value)) {
    throw SceneError("",
                     "no parameters are set here; load a scene first, e.g. roslaunch variator_sim "
                     "variator_sim.launch scene:=FILE.yaml");
  }
  return toParameterTree(value);
}

/// Machine code is made before the first tick or not at all.
void prepareMachineCode(Simulation& simulation) {
  const MachineCode wanted = simulation.scene().solver.machine_code;
  const bool is_loaded = simulation.loadMachineCode(wanted != MachineCode::kNever);
  const char* const text = simulation.machineCode().c_str();
  if (is_loaded || wanted == MachineCode::kNever) {
    ROS_DEBUG("formulas are run by %s", text);
  } else if (wanted == MachineCode::kAlways) {
    ROS_WARN("formulas are run by %s", text);
  } else {
    ROS_INFO("formulas are run by %s", text);
  }
}

}  // namespace

std::shared_ptr<SimulationServer> makeServerFromParameters(const ros::NodeHandle& public_handle,
                                                           const ros::NodeHandle& private_handle,
                                                           Sharing sharing) {
  const std::string& name_space = private_handle.getNamespace();
  try {
    ParameterTree tree = readParameters(private_handle);
    applyOwnOverrides(tree);
    const NodeSettings settings = readNodeSettings(tree);
    PluginlibComponentFactory factory;
    Simulation simulation(readScene(tree, factory, nodeNames()));
    simulation.estimateErrors(settings.estimate_error);
    prepareMachineCode(simulation);
    return std::make_shared<SimulationServer>(public_handle, private_handle, std::move(simulation),
                                              settings, sharing);
  } catch (const SceneError& error) {
    const char* separator = error.keyPath().empty() ? ": " : "/";
    throw std::runtime_error(name_space + separator + error.what());
  } catch (const std::exception& error) {
    throw std::runtime_error(name_space + ": " + error.what());
  }
}

}  // namespace variator_sim
