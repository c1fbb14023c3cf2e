#include "ros/variator_nodelet.h"

#include <exception>

#include "ros/server_from_parameters.h"

namespace variator_sim {

void VariatorNodelet::onInit() {
  try {
    server_ = makeServerFromParameters(getNodeHandle(), getPrivateNodeHandle(), Sharing::kMessages);
  } catch (const std::exception& error) {
    NODELET_FATAL("%s", error.what());
    throw;
  }
}

}  // namespace variator_sim
