#include "variator_sim/torques/diesel_engine.h"

#include "rate_derivatives.h"
#include "smooth.h"

namespace variator_sim {

void DieselEngine::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"shaft", "full_load", "rack", "friction", "idle_governor"}) {
    parameters.allow(key);
  }
  shaft_ = context.readShaft("shaft");

  ParameterReader full_load = parameters.section("full_load");
  full_load_ = Table::read(full_load, {"speed", Range::any()}, {"torque", Range::notNegative()},
                           Table::Beyond::kConstant);
  full_load.finish();
  rack_ = InputValue::read(context, "rack", Range::between(0.0, 1.0));

  if (parameters.has("friction")) {
    ParameterReader friction = parameters.section("friction");
    for (const char* key : {"constant", "linear", "regularization_speed"}) friction.allow(key);
    friction_constant_ = friction.number("constant", Range::notNegative());
    friction_linear_ = friction.number("linear", Range::notNegative(), 0.0);
    friction_scale_ = 1.0 / friction.number("regularization_speed", Range::positive(), 1.0);
    friction.finish();
  }

  has_governor_ = parameters.has("idle_governor");
  if (has_governor_) {
    ParameterReader governor = parameters.section("idle_governor");
    for (const char* key : {"speed", "band"}) governor.allow(key);
    const double speed = governor.number("speed", Range::positive());
    const double band = governor.number("band", Range::positive());
    governor.finish();
    governor_begin_ = speed - band;
    governor_scale_ = 0.5 / band;
  }
}

void DieselEngine::doAddTorque(const StateView& state, double* torque) const {
  const double w = state.velocity[shaft_];
  double r = rack_.value(state);
  if (has_governor_) {
    // r = u + (1 - u) g = 1 - (1 - u) S
    r = 1.0 - (1.0 - r) * smoothStep((w - governor_begin_) * governor_scale_).value;
  }
  const double friction =
      friction_constant_ * smoothSign(w * friction_scale_).value + friction_linear_ * w;
  torque[shaft_] += r * full_load_.value(w) - friction;
}

void DieselEngine::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  const double w = state.velocity[shaft_];
  const double epsilon = state.acceleration[shaft_];
  const double u = rack_.value(state);
  double r = u;
  double r_rate = rack_.rate(state);
  if (has_governor_) {
    const SmoothValue S = smoothStep((w - governor_begin_) * governor_scale_);
    r = 1.0 - (1.0 - u) * S.value;
    r_rate = r_rate * S.value - (1.0 - u) * S.slope * governor_scale_ * epsilon;
  }
  const double friction_slope =
      friction_constant_ * friction_scale_ * smoothSign(w * friction_scale_).slope +
      friction_linear_;
  double rate = (r * full_load_.slope(w) - friction_slope) * epsilon;
  // Looked up for a rack that moves only.
  if (r_rate != 0.0) rate += r_rate * full_load_.value(w);
  torque_rate[shaft_] += rate;
}

void DieselEngine::doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const {
  const double w = state.velocity[shaft_];
  const double epsilon = state.acceleration[shaft_];
  // r = 1 - (1 - u) S(w) and its derivatives by w and by t alone; S = 1 without governor
  SmoothValue S{1.0, 0.0, 0.0};
  if (has_governor_) S = smoothStep((w - governor_begin_) * governor_scale_);
  const double closed = 1.0 - rack_.value(state);
  const double r = 1.0 - closed * S.value;
  const double r_slope = -closed * S.slope * governor_scale_;
  const double r_curvature = -closed * S.curvature * governor_scale_ * governor_scale_;
  const double r_rate = rack_.rate(state) * S.value;
  const double r_rate_slope = rack_.rate(state) * S.slope * governor_scale_;
  const SmoothValue sign = smoothSign(w * friction_scale_);
  const double F_slope = friction_constant_ * friction_scale_ * sign.slope + friction_linear_;
  const double F_curvature =
      friction_constant_ * friction_scale_ * friction_scale_ * sign.curvature;
  const SmoothValue T{full_load_.value(w), full_load_.slope(w), full_load_.curvature(w)};
  // Q' = r_t T + (r T)_w epsilon - F_w epsilon
  RateDerivatives d(derivatives, shaftCount());
  d.byVelocity(shaft_, shaft_) +=
      r_rate_slope * T.value + r_rate * T.slope +
      (r_curvature * T.value + 2.0 * r_slope * T.slope + r * T.curvature - F_curvature) * epsilon;
  d.byAcceleration(shaft_, shaft_) += r_slope * T.value + r * T.slope - F_slope;
}

}  // namespace variator_sim
