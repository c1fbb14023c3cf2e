#include <memory>

#include "classical_gauss.h"
#include "formal_gauss.h"
#include "generalized_gauss.h"
#include "motion.h"

namespace variator_sim {

std::unique_ptr<PrincipleSystem> makeSystem(const Scene& scene) {
  if (scene.principle == Principle::kGeneralizedGauss) {
    return std::make_unique<GeneralizedGauss>(scene);
  }
  if (scene.hasOrder3()) return std::make_unique<FormalGauss>(scene);
  return std::make_unique<ClassicalGauss>(scene);
}

}  // namespace variator_sim
