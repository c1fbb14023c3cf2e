#include "variator_sim/torques/vehicle_resistance.h"

#include <cmath>
#include <string>

#include "rate_derivatives.h"
#include "ratio.h"
#include "smooth.h"

namespace variator_sim {
namespace {

constexpr double kGravity = 9.80665;  // m/s^2, standard
/// Steeper than 45 degrees no vehicle runs.
const Range kGrades = Range::between(-1.0, 1.0);

}  // namespace

void VehicleResistance::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key :
       {"shaft", "law", "wheel_radius", "ratio", "regularization_speed", "grade", "mass"}) {
    parameters.allow(key);
  }
  shaft_ = context.readShaft("shaft");
  const std::string law = parameters.choice("law", {"davis", "road"});
  radius_ = parameters.number("wheel_radius", Range::positive()) / readRatio(parameters);
  sign_scale_ = 1.0 / parameters.number("regularization_speed", Range::positive(), 0.1);
  if (law == "road" || parameters.has("grade") || parameters.has("mass")) {
    weight_ = kGravity * parameters.number("mass", Range::positive());
  }
  if (law == "davis") {
    for (const char* key : {"constant", "linear", "quadratic"}) parameters.allow(key);
    constant_ = parameters.number("constant", Range::notNegative());
    linear_ = parameters.number("linear", Range::notNegative());
    quadratic_ = parameters.number("quadratic", Range::notNegative());
  } else {
    for (const char* key : {"rolling_coefficient", "drag_area", "air_density"}) {
      parameters.allow(key);
    }
    rolling_ = weight_ * parameters.number("rolling_coefficient", Range::notNegative());
    const double drag_area = parameters.number("drag_area", Range::notNegative());
    quadratic_ = 0.5 * drag_area * parameters.number("air_density", Range::positive(), 1.2);
  }
  readGrade(parameters);
}

void VehicleResistance::readGrade(ParameterReader& parameters) {
  const ParameterTree* tree = parameters.raw("grade");
  if (tree != nullptr && tree->kind() == ParameterTree::Kind::kDictionary) {
    ParameterReader section = parameters.section("grade");
    grade_ =
        Table::read(section, {"time", Range::any()}, {"grade", kGrades}, Table::Beyond::kConstant);
    section.finish();
    grade_varies_ = true;
  } else {
    const double grade = parameters.number("grade", kGrades, 0.0);
    cosine_ = 1.0 / std::sqrt(1.0 + grade * grade);
    sine_ = grade * cosine_;
  }
}

void VehicleResistance::doAddTorque(const StateView& state, double* torque) const {
  double sine = sine_;
  double cosine = cosine_;
  if (grade_varies_) {
    const double grade = grade_.value(state.time);
    cosine = 1.0 / std::sqrt(1.0 + grade * grade);
    sine = grade * cosine;
  }
  const double v = radius_ * state.velocity[shaft_];
  const double s = smoothSign(v * sign_scale_).value;
  const double F =
      (constant_ + rolling_ * cosine + quadratic_ * v * v) * s + linear_ * v + weight_ * sine;
  torque[shaft_] -= radius_ * F;
}

void VehicleResistance::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  const double v = radius_ * state.velocity[shaft_];
  const SmoothValue s = smoothSign(v * sign_scale_);
  double cosine = cosine_;
  double F_rate = 0.0;
  if (grade_varies_) {
    // i = tan alpha: (sin alpha)' = i' cos^3 alpha, (cos alpha)' = -i i' cos^3 alpha
    const double grade = grade_.value(state.time);
    cosine = 1.0 / std::sqrt(1.0 + grade * grade);
    const double sine_rate = grade_.slope(state.time) * cosine * cosine * cosine;
    F_rate = (weight_ - rolling_ * grade * s.value) * sine_rate;
  }
  const double F_slope =
      (constant_ + rolling_ * cosine + quadratic_ * v * v) * s.slope * sign_scale_ +
      2.0 * quadratic_ * v * s.value + linear_;
  F_rate += F_slope * radius_ * state.acceleration[shaft_];
  torque_rate[shaft_] -= radius_ * F_rate;
}

void VehicleResistance::doAddTorqueRateDerivatives(const StateView& state,
                                                   double* derivatives) const {
  const double v = radius_ * state.velocity[shaft_];
  const SmoothValue s = smoothSign(v * sign_scale_);
  const double s_slope = s.slope * sign_scale_;
  const double s_curvature = s.curvature * sign_scale_ * sign_scale_;
  double cosine = cosine_;
  double by_v = 0.0;  // of F'
  if (grade_varies_) {
    const double grade = grade_.value(state.time);
    cosine = 1.0 / std::sqrt(1.0 + grade * grade);
    by_v = -rolling_ * grade * s_slope * grade_.slope(state.time) * cosine * cosine * cosine;
  }
  const double level = constant_ + rolling_ * cosine + quadratic_ * v * v;
  const double F_slope = level * s_slope + 2.0 * quadratic_ * v * s.value + linear_;
  const double F_curvature =
      level * s_curvature + 4.0 * quadratic_ * v * s_slope + 2.0 * quadratic_ * s.value;
  by_v += F_curvature * radius_ * state.acceleration[shaft_];
  // Q' = -rho F', v = rho omega
  RateDerivatives d(derivatives, shaftCount());
  d.byVelocity(shaft_, shaft_) -= radius_ * radius_ * by_v;
  d.byAcceleration(shaft_, shaft_) -= radius_ * radius_ * F_slope;
}

}  // namespace variator_sim
