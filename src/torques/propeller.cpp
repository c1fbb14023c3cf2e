#include "variator_sim/torques/propeller.h"

#include "rate_derivatives.h"
#include "smooth.h"

namespace variator_sim {

void Propeller::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"shaft", "regularization_speed"}) parameters.allow(key);
  shaft_ = context.readShaft("shaft");
  bool has_advance = false;
  if (parameters.has("coefficient") || !parameters.has("torque_coefficient")) {
    parameters.allow("coefficient");
    quadratic_ = parameters.number("coefficient", Range::notNegative());
  } else {
    for (const char* key : {"torque_coefficient", "diameter", "density", "advance"}) {
      parameters.allow(key);
    }
    constexpr double turn = 2.0 * 3.14159265358979323846;
    const double K_Q0 = parameters.number("torque_coefficient", Range::notNegative());
    const double D = parameters.number("diameter", Range::positive());
    const double density = parameters.number("density", Range::positive(), 1025.0);
    quadratic_ = density * K_Q0 * D * D * D * D * D / (turn * turn);
    has_advance = parameters.has("advance");
    if (has_advance) {
      ParameterReader advance = parameters.section("advance");
      for (const char* key : {"speed", "slope"}) advance.allow(key);
      const double V = advance.number("speed");
      const double K_Q1 = advance.number("slope", Range::notNegative());
      advance.finish();
      bilinear_ = density * K_Q1 * V * D * D * D * D / turn;
    }
  }
  regularization_speed_ =
      has_advance ? parameters.number("regularization_speed", Range::positive())
                  : parameters.number("regularization_speed", Range::notNegative(), 0.0);
}

void Propeller::doAddTorque(const StateView& state, double* torque) const {
  // Q = -(k w - m) a(w)
  const double w = state.velocity[shaft_];
  const SmoothValue a = smoothMagnitude(w, regularization_speed_);
  torque[shaft_] -= (quadratic_ * w - bilinear_) * a.value;
}

void Propeller::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  // Q' = -(k a(w) + (k w - m) a'(w)) epsilon
  const double w = state.velocity[shaft_];
  const SmoothValue a = smoothMagnitude(w, regularization_speed_);
  torque_rate[shaft_] -=
      (quadratic_ * a.value + (quadratic_ * w - bilinear_) * a.slope) * state.acceleration[shaft_];
}

void Propeller::doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const {
  // Q' = -(k a(w) + (k w - m) a'(w)) epsilon
  const double w = state.velocity[shaft_];
  const SmoothValue a = smoothMagnitude(w, regularization_speed_);
  const double linear = quadratic_ * w - bilinear_;
  RateDerivatives d(derivatives, shaftCount());
  d.byVelocity(shaft_, shaft_) -=
      (2.0 * quadratic_ * a.slope + linear * a.curvature) * state.acceleration[shaft_];
  d.byAcceleration(shaft_, shaft_) -= quadratic_ * a.value + linear * a.slope;
}

}  // namespace variator_sim
