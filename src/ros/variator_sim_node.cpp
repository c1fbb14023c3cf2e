/// One scene, read from the node's private parameters, as a ROS node.
#include <ros/ros.h>

#include <exception>
#include <string>

#include "ros/node_settings.h"
#include "ros/plugin_loader.h"
#include "ros/simulation_server.h"
#include "ros/xmlrpc_tree.h"
#include "variator_sim/scene.h"

namespace {

constexpr int kBadScene = 2;

variator_sim::ParameterTree readParameters(const std::string& name_space) {
  XmlRpc::XmlRpcValue value;
  if (!ros::param::get(name_space, value)) {
    throw variator_sim::SceneError(
        "",
        "no parameters are set here; load a scene first, e.g. roslaunch variator_sim "
        "variator_sim.launch scene:=FILE.yaml");
  }
  return variator_sim::toParameterTree(value);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace variator_sim;
  ros::init(argc, argv, "variator");
  const ros::NodeHandle public_handle;
  const ros::NodeHandle private_handle("~");
  const std::string& name_space = private_handle.getNamespace();
  try {
    const ParameterTree tree = readParameters(name_space);
    const NodeSettings settings = readNodeSettings(tree);
    PluginlibComponentFactory factory;
    const SimulationServer server(public_handle, private_handle,
                                  Simulation(readScene(tree, factory)), settings);
    ros::waitForShutdown();
  } catch (const SceneError& error) {
    const char* separator = error.keyPath().empty() ? ": " : "/";
    ROS_FATAL("%s%s%s", name_space.c_str(), separator, error.what());
    return kBadScene;
  } catch (const std::exception& error) {
    ROS_FATAL("%s: %s", name_space.c_str(), error.what());
    return kBadScene;
  }
  return 0;
}
