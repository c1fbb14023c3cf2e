/// One scene, read from the node's private parameters, as a ROS node.
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <future>
#include <memory>
#include <thread>

#include "ros/server_from_parameters.h"
#include "variator_sim/interruption.h"
#include "variator_sim/message_text.h"

namespace {

constexpr int kBadScene = 2;
constexpr int kBadOutput = 3;

constexpr char kUsage[] =
    "Simulates a drivetrain in real time, as its private parameters describe it.\n"
    "\n"
    "usage: roslaunch variator_sim variator_sim.launch scene:=SCENE.yaml [NAME:=VALUE]..\n"
    "       (roslaunch variator_sim variator_sim.launch --ros-args lists the names)\n"
    "   or: rosparam load SCENE.yaml /variator\n"
    "       rosrun variator_sim variator_sim_node [__name:=variator] [NAME:=OTHER_NAME]..\n"
    "\n"
    "A ROS master has to run. The log says when the node is ready, and names its inputs.\n"
    "\n"
    "topics it reads   ~TOPIC of each commanded input (std_msgs/Float64), ~commands\n"
    "       publishes  ~state, ~elements, ~events, ~inputs, ~outputs, ~states,\n"
    "                  ~variables, ~principle, ~energy, joint_states, ~scene,\n"
    "                  ~status, /diagnostics, ~parameter_descriptions, ~parameter_updates;\n"
    "                  with publish_clock /clock\n"
    "services          ~pause, ~resume, ~reset, ~reset_time, ~step, ~get_state, ~set_state,\n"
    "                  ~set_parameters\n"
    "parameters        the scene, and tick_rate, publish_rate, real_time_factor, start_paused,\n"
    "                  publish_clock, realtime_priority, lock_memory, estimate_error, overrides,\n"
    "                  scene_folder\n"
    "\n"
    "Exit status: 0 after a shutdown, 2 for a bad scene, parameter or argument.\n"
    "Without a master: rosrun variator_sim simulate --help\n";

bool isEnding() {
  return !ros::ok() || ros::isShuttingDown();
}

/// Bounds the time of a shutdown: a scene's reading, or a step, that does not end must not hold the
/// process.
void endSoon() {
  std::thread([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    std::_Exit(0);
  }).detach();
}

/// Reads the scene in a thread of its own, so that a shutdown is noticed meanwhile.
std::shared_ptr<void> makeServer(const ros::NodeHandle& public_handle,
                                 const ros::NodeHandle& private_handle) {
  auto server = std::async(std::launch::async, [&] {
    const variator_sim::Interruption interruption(isEnding);
    return variator_sim::makeServerFromParameters(public_handle, private_handle);
  });
  while (server.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) {
    if (!isEnding()) continue;
    endSoon();
    break;
  }
  return server.get();
}

/// ros::waitForShutdown polls 20 times a second; the end of the global queue wakes this thread at
/// once.
void waitForShutdown() {
  while (!isEnding()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(1.0));
  }
  endSoon();
  ros::waitForShutdown();  // until it is complete
}

int runNode(int argc, char** argv) {
  ros::init(argc, argv, "variator");  // takes NAME:=VALUE out of the arguments
  if (argc > 1) {
    std::fprintf(stderr,
                 "variator_sim_node: unknown argument %s; allowed: --help, NAME:=VALUE. A scene "
                 "comes from the parameter server: roslaunch variator_sim variator_sim.launch "
                 "scene:=FILE.yaml\n",
                 variator_sim::inQuotes(argv[1]).c_str());
    return kBadScene;
  }
  // roscpp ends well on SIGINT only.
  for (const int order : {SIGTERM, SIGHUP}) {
    std::signal(order, [](int) { ros::requestShutdown(); });
  }
  const ros::NodeHandle public_handle;
  const ros::NodeHandle private_handle("~");
  // The log exists while a handle does.
  try {
    const auto server = makeServer(public_handle, private_handle);
    waitForShutdown();
  } catch (const std::exception& error) {
    if (isEnding()) return 0;
    ROS_FATAL("%s", error.what());
    return kBadScene;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace variator_sim;
  // Before anything asks for a master.
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--help") != 0 && std::strcmp(argv[i], "-h") != 0) continue;
    if (std::fputs(kUsage, stdout) >= 0 && std::fflush(stdout) == 0) return 0;
    std::perror("variator_sim_node: standard output");
    return kBadOutput;
  }
  try {
    return runNode(argc, argv);
  } catch (const std::exception& error) {
    // roscpp itself throws before there is a log, as for __name:='a b'.
    std::fprintf(stderr, "variator_sim_node: %s\n", presentable(error.what()).c_str());
  }
  return kBadScene;
}
