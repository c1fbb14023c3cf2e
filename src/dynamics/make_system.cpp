#include <memory>

#include "dynamics/classical_gauss.h"
#include "dynamics/formal_gauss.h"
#include "dynamics/generalized_gauss.h"
#include "motion/motion.h"

namespace variator_sim {

std::unique_ptr<PrincipleSystem> makeSystem(const Scene& scene) {
  if (scene.principle == Principle::kGeneralizedGauss) {
    return std::make_unique<GeneralizedGauss>(scene);
  }
  if (scene.hasOrder3()) return std::make_unique<FormalGauss>(scene);
  return std::make_unique<ClassicalGauss>(scene);
}

}  // namespace variator_sim
