#include <memory>

#include "dynamics/classical_gauss.h"
#include "dynamics/formal_gauss.h"
#include "dynamics/generalized_gauss.h"
#include "dynamics/principle_system.h"

namespace variator_sim {

std::unique_ptr<PrincipleSystem> makeSystem(const Scene& scene, const Shortcuts& shortcuts) {
  if (scene.principle == Principle::kGeneralizedGauss) {
    return std::make_unique<GeneralizedGauss>(scene, shortcuts);
  }
  if (scene.hasOrder3()) return std::make_unique<FormalGauss>(scene, shortcuts);
  return std::make_unique<ClassicalGauss>(scene, shortcuts);
}

}  // namespace variator_sim
