#include "variator_sim/torques/cutting_torque.h"

#include <cmath>
#include <limits>

#include "rate_derivatives.h"
#include "smooth.h"

namespace variator_sim {

void CuttingTorque::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key :
       {"shaft", "torque", "begin", "ramp", "end", "tooth_passing", "regularization_speed"}) {
    parameters.allow(key);
  }
  shaft_ = context.readShaft("shaft");
  torque_ = parameters.number("torque", Range::notNegative());
  begin_ = parameters.number("begin");
  const double ramp = parameters.number("ramp", Range::positive());
  ramp_scale_ = 1.0 / ramp;
  end_ = parameters.number("end", Range::atLeast(begin_ + ramp),
                           std::numeric_limits<double>::infinity());
  if (parameters.has("tooth_passing")) {
    ParameterReader section = parameters.section("tooth_passing");
    for (const char* key : {"teeth", "amplitude", "phase"}) section.allow(key);
    teeth_ = section.integer("teeth", 1, 10000);
    amplitude_ = section.number("amplitude", Range::between(0.0, 1.0));
    phase_ = section.number("phase", Range::any(), 0.0);
    // Added to a large phase the angle would be lost in rounding.
    if (std::abs(phase_) > 4.0) phase_ = std::atan2(std::sin(phase_), std::cos(phase_));
    section.finish();
  }
  sign_scale_ = 1.0 / parameters.number("regularization_speed", Range::positive(), 0.1);
}

void CuttingTorque::doAddTorque(const StateView& state, double* torque) const {
  const double E = smoothStep((state.time - begin_) * ramp_scale_).value -
                   smoothStep((state.time - end_) * ramp_scale_).value;
  if (E == 0.0) return;
  double P = 1.0;
  if (teeth_ > 0.0) P += amplitude_ * std::sin(teeth_ * state.angle[shaft_] + phase_);
  torque[shaft_] -= torque_ * E * P * smoothSign(state.velocity[shaft_] * sign_scale_).value;
}

void CuttingTorque::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  const SmoothValue entry = smoothStep((state.time - begin_) * ramp_scale_);
  const SmoothValue exit = smoothStep((state.time - end_) * ramp_scale_);
  const double E = entry.value - exit.value;
  if (E == 0.0) return;  // E' is 0 there too
  const double E_rate = (entry.slope - exit.slope) * ramp_scale_;
  const double w = state.velocity[shaft_];
  double P = 1.0;
  double P_rate = 0.0;
  if (teeth_ > 0.0) {
    const double tooth_angle = teeth_ * state.angle[shaft_] + phase_;
    P += amplitude_ * std::sin(tooth_angle);
    P_rate = amplitude_ * teeth_ * std::cos(tooth_angle) * w;
  }
  const SmoothValue s = smoothSign(w * sign_scale_);
  torque_rate[shaft_] -= torque_ * ((E_rate * P + E * P_rate) * s.value +
                                    E * P * s.slope * sign_scale_ * state.acceleration[shaft_]);
}

void CuttingTorque::doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const {
  const SmoothValue entry = smoothStep((state.time - begin_) * ramp_scale_);
  const SmoothValue exit = smoothStep((state.time - end_) * ramp_scale_);
  const double E = entry.value - exit.value;
  if (E == 0.0) return;
  const double E_rate = (entry.slope - exit.slope) * ramp_scale_;
  const double w = state.velocity[shaft_];
  double P = 1.0;
  double P_slope = 0.0;
  double P_curvature = 0.0;
  if (teeth_ > 0.0) {
    const double tooth_angle = teeth_ * state.angle[shaft_] + phase_;
    const double sine = amplitude_ * std::sin(tooth_angle);
    P += sine;
    P_slope = amplitude_ * teeth_ * std::cos(tooth_angle);
    P_curvature = -teeth_ * teeth_ * sine;
  }
  // Q' = -T ((E' P + E dP/dphi w) s + E P ds/dw epsilon)
  const SmoothValue s = smoothSign(w * sign_scale_);
  const double s_slope = s.slope * sign_scale_;
  const double s_curvature = s.curvature * sign_scale_ * sign_scale_;
  const double epsilon = state.acceleration[shaft_];
  RateDerivatives d(derivatives, shaftCount());
  d.byAngle(shaft_, shaft_) -= torque_ * ((E_rate * P_slope + E * P_curvature * w) * s.value +
                                          E * P_slope * s_slope * epsilon);
  d.byVelocity(shaft_, shaft_) -=
      torque_ * (E * P_slope * s.value + (E_rate * P + E * P_slope * w) * s_slope +
                 E * P * s_curvature * epsilon);
  d.byAcceleration(shaft_, shaft_) -= torque_ * E * P * s_slope;
}

}  // namespace variator_sim
