#include "variator_sim/constraints/kinematic_ratio.h"

namespace variator_sim {

void KinematicRatio::doConfigure(ComponentContext& context) {
  useShafts(context.readShafts("shafts", 2));
  ratio_ = TimeValue::read(context, "ratio", Range::any(), TimeValue::Need::kTwice, 0);
  useInput(0, ratio_.input());
}

}  // namespace variator_sim
