#include "variator_sim/constraints/jerk_limit.h"

namespace variator_sim {

void JerkLimit::doConfigure(ComponentContext& context) {
  useShafts({context.readShaft("shaft")});
  limit_ = context.parameters().number("limit", Range::positive());
  time_constant_ = context.parameters().number("time_constant", Range::positive());
  acceleration_ = TimeValue::read(context, "acceleration", Range::any(), TimeValue::Need::kOnce, 0);
  useInput(0, acceleration_.input());
}

}  // namespace variator_sim
