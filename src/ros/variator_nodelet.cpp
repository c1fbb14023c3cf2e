/// One scene, read from the private parameters, as a nodelet, registered with pluginlib apart from
/// the components: their users need no nodelets.
#include <nodelet/nodelet.h>

#include <exception>
#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "ros/server_from_parameters.h"

namespace variator_sim {

/// A nodelet with its own threads and callback queue, as the node has: the manager's are not used.
/// Nodelets of the same manager get its messages without a copy.
class VariatorNodelet : public nodelet::Nodelet {
 private:
  /// Throws, after it has logged why, when the scene is bad: then the manager rejects the nodelet.
  void onInit() override {
    try {
      server_ = makeServerFromParameters(getNodeHandle(), getPrivateNodeHandle());
    } catch (const std::exception& error) {
      NODELET_FATAL("%s", error.what());
      throw;
    }
  }

  std::shared_ptr<void> server_;
};

}  // namespace variator_sim

PLUGINLIB_EXPORT_CLASS(variator_sim::VariatorNodelet, nodelet::Nodelet)
