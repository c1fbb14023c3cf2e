#include "variator_sim/constraints/acceleration_magnitude.h"

namespace variator_sim {

void AccelerationMagnitude::doConfigure(ComponentContext& context) {
  useShafts(context.readShafts("shafts", 2));
  magnitude_ = context.parameters().number("magnitude", Range::positive());
}

}  // namespace variator_sim
