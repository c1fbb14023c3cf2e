#include "variator_sim/constraints/power_flow.h"

namespace variator_sim {

void PowerFlow::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"power", "efficiency", "smoothing_power"}) parameters.allow(key);
  useShafts(context.readShafts("shafts", 2));
  const std::vector<double> inertias = parameters.numbers("inertias", 2, Range::positive());
  inertia_a_ = inertias[0];
  inertia_b_ = inertias[1];
  imposes_power_ = !parameters.has("efficiency");
  if (imposes_power_) {
    if (parameters.has("smoothing_power")) {
      throw SceneError(parameters.keyPath("smoothing_power"),
                       "belongs to 'efficiency', which is not given");
    }
    power_ = TimeValue::read(context, "power", Range::any(), TimeValue::Need::kOnce, 0);
    useInput(0, power_.input());
    return;
  }
  if (parameters.has("power")) {
    throw SceneError(parameters.keyPath("power"),
                     "and 'efficiency' are two forms of this constraint; allowed: one of them");
  }
  efficiency_ = parameters.number("efficiency", Range{0.0, 1.0, false, true});
  smoothing_power_ = parameters.number("smoothing_power", Range::positive());
}

}  // namespace variator_sim
