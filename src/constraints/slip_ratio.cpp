#include "variator_sim/constraints/slip_ratio.h"

namespace variator_sim {

void SlipRatio::doConfigure(ComponentContext& context) {
  useShafts(context.readShafts("shafts", 2));
  time_constant_ = context.parameters().number("time_constant", Range::positive());
  ratio_ = TimeValue::read(context, "ratio", Range::any(), TimeValue::Need::kOnce, 0);
  useInput(0, ratio_.input());
}

}  // namespace variator_sim
