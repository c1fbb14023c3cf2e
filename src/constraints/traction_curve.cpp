#include "variator_sim/constraints/traction_curve.h"

#include <cmath>

namespace variator_sim {

void TractionCurve::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  useShafts(context.readShafts("shafts", 2));
  ratio_ = TimeValue::read(context, "ratio", Range::any(), TimeValue::Need::kOnce, 0);
  useInput(0, ratio_.input());
  inertia_ = parameters.number("inertia", Range::positive());
  const double sharpness = parameters.number("sharpness", Range{0.0, 100.0, false, true}, 2.0);
  slip_scale_ =
      parameters.number("nominal_slip", Range{0.0, 1.0, false, false}) / std::sinh(sharpness);
  torque_scale_ = sharpness / parameters.number("nominal_torque", Range::positive());
  load_ = TimeValue::read(context, "load", Range::any(), TimeValue::Need::kOnce, 1, 0.0);
  useInput(1, load_.input());
  load_square_ = parameters.number("load_square", Range::notNegative(), load_square_);
  regularization_speed_ =
      parameters.number("regularization_speed", Range::positive(), regularization_speed_);
}

}  // namespace variator_sim
