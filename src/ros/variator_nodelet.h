/// One scene, read from the private parameters, as a nodelet.
#pragma once

#include <nodelet/nodelet.h>

#include <memory>

namespace variator_sim {

class SimulationServer;

/// A nodelet with its own threads and callback queue, as the node has: the manager's are not used.
/// Nodelets of the same manager get its messages without a copy.
class VariatorNodelet : public nodelet::Nodelet {
 private:
  /// Throws, after it has logged why, when the scene is bad: then the manager rejects the nodelet.
  void onInit() override;

  std::shared_ptr<SimulationServer> server_;
};

}  // namespace variator_sim
