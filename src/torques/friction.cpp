#include "variator_sim/torques/friction.h"

#include <cmath>
#include <utility>
#include <vector>

#include "rate_derivatives.h"
#include "ratio.h"
#include "smooth.h"

namespace variator_sim {

void Friction::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key :
       {"coulomb", "static", "stribeck_speed", "viscous", "regularization_speed"}) {
    parameters.allow(key);
  }
  if (parameters.has("shafts")) {
    for (const char* key : {"shafts", "ratio"}) parameters.allow(key);
    const std::vector<int> shafts = context.readShafts("shafts", 2);
    a_ = shafts[0];
    b_ = shafts[1];
    ratio_ = readRatio(parameters);
  } else {
    parameters.allow("shaft");
    a_ = context.readShaft("shaft");
  }
  coulomb_ = parameters.number("coulomb", Range::notNegative(), 0.0);
  if (parameters.has("static")) {
    excess_ = parameters.number("static", Range::atLeast(coulomb_)) - coulomb_;
    stribeck_scale_ = 1.0 / parameters.number("stribeck_speed", Range::positive());
  } else if (parameters.has("stribeck_speed")) {
    throw SceneError(parameters.keyPath("stribeck_speed"),
                     "belongs to 'static', which is missing; allowed: both or neither");
  }
  viscous_ = parameters.number("viscous", Range::notNegative(), 0.0);
  sign_scale_ = 1.0 / parameters.number("regularization_speed", Range::positive(), 0.01);
}

void Friction::doAddTorque(const StateView& state, double* torque) const {
  double w = state.velocity[a_];
  if (b_ >= 0) w -= ratio_ * state.velocity[b_];
  // T = (T_c + (T_s - T_c) exp(-(w/w_s)^2)) tanh(w/w_0) + b w
  double level = coulomb_;
  if (excess_ > 0.0) {
    const double x = w * stribeck_scale_;
    level += excess_ * std::exp(-x * x);
  }
  const double T = level * smoothSign(w * sign_scale_).value + viscous_ * w;
  torque[a_] -= T;
  if (b_ >= 0) torque[b_] += ratio_ * T;
}

void Friction::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  double w = state.velocity[a_];
  double w_rate = state.acceleration[a_];
  if (b_ >= 0) {
    w -= ratio_ * state.velocity[b_];
    w_rate -= ratio_ * state.acceleration[b_];
  }
  double level = coulomb_;
  double level_slope = 0.0;
  if (excess_ > 0.0) {
    const double x = w * stribeck_scale_;
    const double bump = excess_ * std::exp(-x * x);
    level += bump;
    level_slope = -2.0 * x * stribeck_scale_ * bump;
  }
  const SmoothValue sign = smoothSign(w * sign_scale_);
  const double T_rate =
      (level_slope * sign.value + level * sign.slope * sign_scale_ + viscous_) * w_rate;
  torque_rate[a_] -= T_rate;
  if (b_ >= 0) torque_rate[b_] += ratio_ * T_rate;
}

void Friction::doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const {
  double w = state.velocity[a_];
  double w_rate = state.acceleration[a_];
  if (b_ >= 0) {
    w -= ratio_ * state.velocity[b_];
    w_rate -= ratio_ * state.acceleration[b_];
  }
  SmoothValue level{coulomb_, 0.0, 0.0};
  if (excess_ > 0.0) {
    const double x = w * stribeck_scale_;
    const double bump = excess_ * std::exp(-x * x);
    const double slope = -2.0 * x * stribeck_scale_ * bump;
    level = {coulomb_ + bump, slope, -2.0 * stribeck_scale_ * (stribeck_scale_ * bump + x * slope)};
  }
  const SmoothValue sign = smoothSign(w * sign_scale_);
  const double sign_slope = sign.slope * sign_scale_;
  const double sign_curvature = sign.curvature * sign_scale_ * sign_scale_;
  const double T_slope = level.slope * sign.value + level.value * sign_slope + viscous_;
  const double T_curvature =
      level.curvature * sign.value + 2.0 * level.slope * sign_slope + level.value * sign_curvature;
  // Q_a' = -T', Q_b' = i T'; T' = T_slope w'
  RateDerivatives d(derivatives, shaftCount());
  for (const auto& [by, factor] : {std::pair(a_, 1.0), std::pair(b_, -ratio_)}) {
    if (by < 0) continue;
    d.byVelocity(by, a_) -= factor * T_curvature * w_rate;
    d.byAcceleration(by, a_) -= factor * T_slope;
    if (b_ < 0) continue;
    d.byVelocity(by, b_) += factor * ratio_ * T_curvature * w_rate;
    d.byAcceleration(by, b_) += factor * ratio_ * T_slope;
  }
}

}  // namespace variator_sim
