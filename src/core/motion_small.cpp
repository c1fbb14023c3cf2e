#include "make_motion.h"

namespace variator_sim {

std::unique_ptr<Motion> makeSmallMotion(Scene scene) {
  switch (scene.shaftCount()) {
    case 1:
      return makeMotion<1>(std::move(scene));
    case 2:
      return makeMotion<2>(std::move(scene));
    case 3:
      return makeMotion<3>(std::move(scene));
    case 4:
      return makeMotion<4>(std::move(scene));
    default:
      return nullptr;
  }
}

}  // namespace variator_sim
