#include "make_motion.h"

namespace variator_sim {

std::unique_ptr<Motion> makeLargeMotion(Scene scene) {
  switch (scene.shaftCount()) {
    case 5:
      return makeMotion<5>(std::move(scene));
    case 6:
      return makeMotion<6>(std::move(scene));
    case 7:
      return makeMotion<7>(std::move(scene));
    case 8:
      return makeMotion<8>(std::move(scene));
    default:
      return nullptr;
  }
}

}  // namespace variator_sim
