#include "motion_of.h"

namespace variator_sim {

std::unique_ptr<Motion> makeLargeMotion(Scene scene) {
  switch (scene.shaftCount()) {
    case 5:
      return std::make_unique<MotionOf<5>>(std::move(scene));
    case 6:
      return std::make_unique<MotionOf<6>>(std::move(scene));
    case 7:
      return std::make_unique<MotionOf<7>>(std::move(scene));
    case 8:
      return std::make_unique<MotionOf<8>>(std::move(scene));
    default:
      return nullptr;
  }
}

}  // namespace variator_sim
