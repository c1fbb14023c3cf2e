/// One scene, read from the private parameters, as a nodelet.
#pragma once

#include <nodelet/nodelet.h>

#include <memory>

namespace variator_sim {

class SimulationServer;

/// Has its own threads and callback queue, as the node has: the manager's threads are not used.
/// Nodelets of the same manager get its messages without a copy.
class VariatorNodelet : public nodelet::Nodelet {
 private:
  /// Throws when the scene is bad, after it has logged why: then the manager refuses to load it,
  /// and goes on.
  void onInit() override;

  std::shared_ptr<SimulationServer> server_;
};

}  // namespace variator_sim
