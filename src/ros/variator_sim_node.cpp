/// One scene, read from the node's private parameters, as a ROS node.
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <csignal>
#include <exception>

#include "ros/server_from_parameters.h"

namespace {

constexpr int kBadScene = 2;

/// ros::waitForShutdown looks 20 times a second; the end of the global queue wakes us at once.
void waitForShutdown() {
  while (ros::ok() && !ros::isShuttingDown()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(1.0));
  }
  ros::waitForShutdown();  // until it is complete
}

}  // namespace

int main(int argc, char** argv) {
  using namespace variator_sim;
  ros::init(argc, argv, "variator");
  // roscpp ends well on SIGINT only.
  for (const int order : {SIGTERM, SIGHUP}) {
    std::signal(order, [](int) { ros::requestShutdown(); });
  }
  const ros::NodeHandle public_handle;
  const ros::NodeHandle private_handle("~");
  try {
    const auto server = makeServerFromParameters(public_handle, private_handle, Sharing::kNothing);
    waitForShutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return kBadScene;
  }
  return 0;
}
