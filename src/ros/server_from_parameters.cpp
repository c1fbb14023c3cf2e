#include "ros/server_from_parameters.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <string>
#include <utility>
#include <vector>

#include "model/thrown.h"
#include "ros/plugin_loader.h"
#include "ros/simulation_server.h"
#include "ros/xmlrpc_tree.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/io/yaml_tree.h"
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
  ParameterTree tree = toParameterTree(value);
  if (tree.kind() != ParameterTree::Kind::kDictionary) {
    throw SceneError("", "a scene (dictionary) is expected, got " + tree.describeKind() + ": " +
                             tree.toText() + "; 'rosparam delete " + private_handle.getNamespace() +
                             "' before one is loaded");
  }
  return tree;
}

/// Publishes ~status while a scene is read, until `is_read`. Subscribers stay connected while the
/// result exists.
ros::Publisher publishEarlyStatus(ros::NodeHandle handle, std::future<void> is_read) {
  ros::Publisher publisher;
  if (is_read.wait_for(std::chrono::milliseconds(500)) == std::future_status::ready)
    return publisher;
  publisher = handle.advertise<SimulationStatus>("status", 10);
  SimulationStatus message;
  message.message = "preparing: the scene is being read";
  do {
    message.header.stamp = ros::Time::now();
    publisher.publish(message);
  } while (is_read.wait_for(std::chrono::milliseconds(100)) != std::future_status::ready);
  return publisher;
}

std::string listed(const std::vector<std::string>& names) {
  return names.empty() ? "none" : join(names, ", ");
}

/// Finds the files of a scene beside it, in the folder that the parameter scene_folder names, or
/// else in the working folder. Throws SceneError where neither has one.
void findFiles(ParameterTree* tree) {
  namespace fs = std::filesystem;
  const ParameterTree* const given = std::as_const(*tree).find("scene_folder");
  const std::string folder = given != nullptr ? given->asText() : "";
  placeFiles(tree, [&](const std::string& name, const std::string& file) {
    std::vector<fs::path> places = {fs::current_path() / file};
    if (!folder.empty()) places.insert(places.begin(), fs::path(folder) / file);
    const auto place = std::find_if(places.begin(), places.end(),
                                    [](const fs::path& it) { return fs::exists(it); });
    if (place != places.end()) return place->string();
    throw SceneError(
        name + "/file",
        inQuotes(file) + " is " +
            (folder.empty() ? "not in the working folder" : "neither in 'scene_folder'") + ", " +
            places.front().string() +
            (folder.empty() ? "; the parameter 'scene_folder' names the folder of the scene"
                            : ", nor in the working folder, " + places.back().string()) +
            "; allowed: a path from there, from the root, or package://PACKAGE/PATH");
  });
}

/// Returns the remedy if a key may be left over from an earlier scene, in the dictionary at
/// `place`; or "".
std::string explainLeftOver(const std::string& message, const std::string& place) {
  if (message.find("unknown key") == std::string::npos &&
      message.find("is not read by the formula") == std::string::npos) {
    return "";
  }
  return "\n(rosparam merges what is set or loaded with what is there: keys of an earlier scene "
         "stay until 'rosparam delete " +
         place + "')";
}

/// Returns a line for the log about a node that is ready; inputs by their full topics.
std::string describeReady(const SceneInfo& scene, const std::string& machine_code,
                          const NodeSettings& settings, const ros::NodeHandle& private_handle) {
  std::vector<std::string> topics;
  for (const std::string& input : scene.inputs) {
    topics.push_back(private_handle.resolveName(input));
  }
  std::string text = "ready: shafts " + listed(scene.shafts) + "; constraints " +
                     listed(scene.constraints) + "; inputs " + listed(topics) + "; principle " +
                     scene.principle + "; stepper " + scene.stepper + "; formulas run by " +
                     machine_code;
  if (settings.start_paused) text += "; paused, ~resume or ~step moves it";
  return text;
}

}  // namespace

std::shared_ptr<void> makeServerFromParameters(const ros::NodeHandle& public_handle,
                                               const ros::NodeHandle& private_handle) {
  const std::string& name_space = private_handle.getNamespace();
  try {
    std::future<ros::Publisher> early_status;
    std::promise<void> is_read;  // which an error breaks: that ends the early status, too
    early_status =
        std::async(std::launch::async, publishEarlyStatus, private_handle, is_read.get_future());
    ParameterTree tree = readParameters(private_handle);
    applyOwnOverrides(tree);
    findFiles(&tree);
    loadParts(&tree);
    const NodeSettings settings = readNodeSettings(tree);
    Simulation simulation(readSceneWithPlugins(tree));
    for (const std::string& warning : simulation.scene().warnings) {
      ROS_WARN("%s: %s", name_space.c_str(), warning.c_str());
    }
    simulation.estimateErrors(settings.estimate_error);
    const auto tell_ready = [scene = toSceneInfo(simulation), settings, private_handle](
                                bool is_missed, const std::string& machine_code) {
      if (is_missed) ROS_WARN("formulas are run by %s", machine_code.c_str());
      ROS_INFO("%s: %s", private_handle.getNamespace().c_str(),
               describeReady(scene, machine_code, settings, private_handle).c_str());
    };
    const MachineCode wanted = simulation.scene().solver.machine_code;
    const bool is_ready = simulation.loadMachineCode(false) || wanted == MachineCode::kNever;
    const std::string machine_code = simulation.machineCode();
    // Machine code is compiled before the first tick or not at all. Another simulation of the scene
    // compiles it, since the node answers meanwhile.
    std::function<void()> preparation;
    if (!is_ready) {
      const auto twin = std::make_shared<Simulation>(simulation.scene(), simulation);
      twin->estimateErrors(settings.estimate_error);
      preparation = [twin, tell_ready, is_asked_for = wanted == MachineCode::kAlways] {
        const bool is_loaded = twin->loadMachineCode(true);
        if (!Interruption::isWanted()) tell_ready(is_asked_for && !is_loaded, twin->machineCode());
      };
    }
    is_read.set_value();
    const ros::Publisher kept = early_status.get();
    auto server = std::make_shared<SimulationServer>(public_handle, private_handle,
                                                     std::move(simulation), settings, preparation);
    if (is_ready) tell_ready(false, machine_code);
    return server;
  } catch (const SceneError& error) {
    const std::string& path = error.keyPath();
    throw Error(
        name_space + (path.empty() ? ": " : "/") + error.what() +
        explainLeftOver(error.message(), name_space + "/" + path.substr(0, path.find('/'))));
  } catch (...) {
    throw Error(name_space + ": " + describeThrown());
  }
}

}  // namespace variator_sim
