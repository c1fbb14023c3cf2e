#include <memory>
#include <string>

#include "dynamics/classical_gauss.h"
#include "dynamics/formal_gauss.h"
#include "dynamics/formula_laws.h"
#include "dynamics/generalized_gauss.h"
#include "dynamics/principle_system.h"

namespace variator_sim {

namespace {

std::unique_ptr<PrincipleSystem> makeOfPrinciple(const Scene& scene, const Shortcuts& shortcuts,
                                                 const PrincipleSystem* like) {
  if (scene.principle == Principle::kGeneralizedGauss) {
    return std::make_unique<GeneralizedGauss>(scene, shortcuts, like);
  }
  if (scene.hasOrder3()) return std::make_unique<FormalGauss>(scene, shortcuts, like);
  return std::make_unique<ClassicalGauss>(scene, shortcuts, like);
}

}  // namespace

std::unique_ptr<PrincipleSystem> makeSystem(const Scene& scene, const Shortcuts& shortcuts,
                                            const PrincipleSystem* like) {
  const bool fits = like != nullptr && haveSameElements(scene, like->scene());
  std::unique_ptr<PrincipleSystem> system =
      makeOfPrinciple(scene, shortcuts, fits ? like : nullptr);
  const StepperKind stepper = scene.solver.stepper;
  const bool needs_series = stepper == StepperKind::kTaylor || stepper == StepperKind::kTaylorFixed;
  if (needs_series && system->series() == nullptr) {
    throw SceneError("solver/stepper",
                     std::string("'") + toString(stepper) +
                         "' needs a motion that has power series, and this one has none: an "
                         "element is no formula (a plugin with a law or a function of its own), or "
                         "a constraint of order 3 is under the principle 'gauss'; allowed here: "
                         "auto and all the others");
  }
  return system;
}

}  // namespace variator_sim
