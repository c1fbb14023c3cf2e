#include "variator_sim/torques/motor_curve.h"

#include <cmath>
#include <string>

#include "rate_derivatives.h"

namespace variator_sim {
namespace {

double readDirection(ParameterReader& parameters) {
  const int direction = parameters.integer("direction", -1, 1, 1);
  if (direction == 0) {
    throw SceneError(parameters.keyPath("direction"), "0 is no direction; allowed: 1, -1");
  }
  return direction;
}

}  // namespace

void MotorCurve::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"shaft", "characteristic", "direction"}) parameters.allow(key);
  shaft_ = context.readShaft("shaft");
  const std::string characteristic = parameters.choice("characteristic", {"kloss", "table", "dc"});
  direction_ = readDirection(parameters);
  if (characteristic == "kloss") {
    configureKloss(context);
  } else if (characteristic == "table") {
    configureTable(context);
  } else {
    configureDc(context);
  }
  if (characteristic_ != Characteristic::kCircuit) {
    input_ = InputValue::read(context, "command", Range::between(0.0, 1.0), 1.0);
  }
}

void MotorCurve::configureKloss(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  characteristic_ = Characteristic::kKloss;
  for (const char* key : {"breakdown_torque", "synchronous_speed", "critical_slip", "command"}) {
    parameters.allow(key);
  }
  peak_ = 2.0 * parameters.number("breakdown_torque", Range::positive());
  const double synchronous_speed = parameters.number("synchronous_speed", Range::positive());
  const double critical_slip = parameters.number("critical_slip", Range::positive());
  // x = s/s_k = (1 - w/w_s)/s_k
  slip_at_rest_ = 1.0 / critical_slip;
  slip_slope_ = 1.0 / (critical_slip * synchronous_speed);
}

void MotorCurve::configureTable(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  characteristic_ = Characteristic::kTable;
  for (const char* key : {"table", "command"}) parameters.allow(key);
  ParameterReader section = parameters.section("table");
  for (const char* key : {"speed", "torque", "beyond"}) section.allow(key);
  const bool constant = section.choice("beyond", {"constant", "linear"}, "constant") == "constant";
  table_ = Table::read(section, {"speed", Range::any()}, {"torque", Range::any()},
                       constant ? Table::Beyond::kConstant : Table::Beyond::kLinear);
  section.finish();
}

void MotorCurve::configureDc(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  if (parameters.has("torque_constant") || parameters.has("resistance") ||
      parameters.has("voltage")) {
    characteristic_ = Characteristic::kCircuit;
    for (const char* key : {"torque_constant", "resistance", "voltage"}) parameters.allow(key);
    const double constant = parameters.number("torque_constant", Range::positive());
    const double resistance = parameters.number("resistance", Range::positive());
    input_ = InputValue::read(context, "voltage", Range::any());
    voltage_gain_ = constant / resistance;
    damping_ = constant * voltage_gain_;
  } else {
    characteristic_ = Characteristic::kLine;
    for (const char* key : {"stall_torque", "no_load_speed", "command"}) parameters.allow(key);
    stall_torque_ = parameters.number("stall_torque", Range::positive());
    damping_ = stall_torque_ / parameters.number("no_load_speed", Range::positive());
  }
}

void MotorCurve::doAddTorque(const StateView& state, double* torque) const {
  const double w = direction_ * state.velocity[shaft_];
  const double u = input_.value(state);
  double M = 0.0;  // u M
  switch (characteristic_) {
    case Characteristic::kKloss: {
      const double x = slip_at_rest_ - slip_slope_ * w;
      M = u * peak_ * x / (1.0 + x * x);
      break;
    }
    case Characteristic::kTable:
      M = u * table_.value(w);
      break;
    case Characteristic::kLine:
      M = u * (stall_torque_ - damping_ * w);
      break;
    case Characteristic::kCircuit:
      M = voltage_gain_ * u - damping_ * w;
      break;
  }
  torque[shaft_] += direction_ * M;
}

void MotorCurve::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  const double w = direction_ * state.velocity[shaft_];
  const double w_rate = direction_ * state.acceleration[shaft_];
  const double u = input_.value(state);
  const double u_rate = input_.rate(state);
  double M_rate = 0.0;  // (u M)'
  switch (characteristic_) {
    case Characteristic::kKloss: {
      // dM/dw = 2 M_k (1 - x^2)/(1 + x^2)^2 dx/dw
      const double x = slip_at_rest_ - slip_slope_ * w;
      const double factor = 1.0 / (1.0 + x * x);
      const double M_slope = -slip_slope_ * (2.0 * factor - 1.0) * factor;
      M_rate = peak_ * (u_rate * x * factor + u * M_slope * w_rate);
      break;
    }
    case Characteristic::kTable:
      M_rate = u * table_.slope(w) * w_rate;
      // Looked up for a command that moves only.
      if (u_rate != 0.0) M_rate += u_rate * table_.value(w);
      break;
    case Characteristic::kLine:
      M_rate = u_rate * (stall_torque_ - damping_ * w) - u * damping_ * w_rate;
      break;
    case Characteristic::kCircuit:
      M_rate = voltage_gain_ * u_rate - damping_ * w_rate;
      break;
  }
  torque_rate[shaft_] += direction_ * M_rate;
}

void MotorCurve::doAddTorqueRateDerivatives(const StateView& state, double* derivatives) const {
  const double w = direction_ * state.velocity[shaft_];
  const double u = input_.value(state);
  const double u_rate = input_.rate(state);
  double by_w = 0.0;       // of (u M)'
  double by_w_rate = 0.0;  // the same by w'
  const auto set = [&](double slope, double curvature) {
    by_w = u_rate * slope + u * curvature * direction_ * state.acceleration[shaft_];
    by_w_rate = u * slope;
  };
  switch (characteristic_) {
    case Characteristic::kKloss: {
      // d2M/dw2 = 2 M_k 2 x (x^2 - 3)/(1 + x^2)^3 (dx/dw)^2
      const double x = slip_at_rest_ - slip_slope_ * w;
      const double factor = 1.0 / (1.0 + x * x);
      set(-peak_ * slip_slope_ * (2.0 * factor - 1.0) * factor,
          peak_ * slip_slope_ * slip_slope_ * 2.0 * x * factor * factor * (1.0 - 4.0 * factor));
      break;
    }
    case Characteristic::kTable:
      set(table_.slope(w), table_.curvature(w));
      break;
    case Characteristic::kLine:
      set(-damping_, 0.0);
      break;
    case Characteristic::kCircuit:
      by_w_rate = -damping_;
      break;
  }
  // w = d omega and Q' = d (u M)': the signs cancel, d^2 = 1
  RateDerivatives d(derivatives, shaftCount());
  d.byVelocity(shaft_, shaft_) += by_w;
  d.byAcceleration(shaft_, shaft_) += by_w_rate;
}

}  // namespace variator_sim
