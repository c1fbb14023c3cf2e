#include "variator_sim/constraints/imposed_jerk.h"

namespace variator_sim {

void ImposedJerk::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"jerk", "velocity_change", "duration", "start"}) parameters.allow(key);
  useShafts({context.readShaft("shaft")});
  if (!parameters.has("velocity_change")) {
    for (const char* key : {"duration", "start"}) {
      if (parameters.has(key)) {
        throw SceneError(parameters.keyPath(key),
                         "belongs to 'velocity_change', which is not given");
      }
    }
    jerk_ = TimeValue::read(context, "jerk", Range::any(), TimeValue::Need::kOnce, 0);
    useInput(0, jerk_.input());
    return;
  }
  if (parameters.has("jerk")) {
    throw SceneError(parameters.keyPath("jerk"),
                     "and 'velocity_change' are two forms of this constraint; allowed: one of "
                     "them");
  }
  velocity_change_ = parameters.number("velocity_change");
  duration_ = parameters.number("duration", Range::positive());
  start_ = parameters.number("start", Range::notNegative(), 0.0);
}

}  // namespace variator_sim
