#include "motion_of.h"

namespace variator_sim {

std::unique_ptr<Motion> makeSmallMotion(Scene scene) {
  switch (scene.shaftCount()) {
    case 1:
      return std::make_unique<MotionOf<1>>(std::move(scene));
    case 2:
      return std::make_unique<MotionOf<2>>(std::move(scene));
    case 3:
      return std::make_unique<MotionOf<3>>(std::move(scene));
    case 4:
      return std::make_unique<MotionOf<4>>(std::move(scene));
    default:
      return nullptr;
  }
}

}  // namespace variator_sim
