#include "variator_sim/constraints/v_belt_ratio.h"

#include <limits>

namespace variator_sim {

void VBeltRatio::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"load", "load_torque"}) parameters.allow(key);
  useShafts(context.readShafts("shafts", 2));
  ratio_low_ = parameters.number("ratio_low", Range::positive());
  ratio_high_ = parameters.number(
      "ratio_high", Range{ratio_low_, std::numeric_limits<double>::infinity(), false, true});
  speed_ = parameters.number("speed", Range::positive());
  width_ = parameters.number("width", Range::positive(), width_);
  if (!parameters.has("load")) {
    if (parameters.has("load_torque")) {
      throw SceneError(parameters.keyPath("load_torque"), "belongs to 'load', which is not given");
    }
    return;
  }
  load_ = TimeValue::read(context, "load", Range::any(), TimeValue::Need::kTwice, 0);
  useInput(0, load_.input());
  load_torque_ = parameters.number("load_torque", Range::positive());
}

}  // namespace variator_sim
