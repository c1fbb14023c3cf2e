#include "variator_sim/torques/elastic_coupling.h"

#include <utility>
#include <vector>

#include "rate_derivatives.h"
#include "ratio.h"

namespace variator_sim {

void ElasticCoupling::doConfigure(ComponentContext& context) {
  ParameterReader& parameters = context.parameters();
  for (const char* key : {"shafts", "stiffness", "damping", "ratio"}) parameters.allow(key);
  const std::vector<int> shafts = context.readShafts("shafts", 2);
  a_ = shafts[0];
  b_ = shafts[1];
  stiffness_ = parameters.number("stiffness", Range::positive());
  damping_ = parameters.number("damping", Range::notNegative(), 0.0);
  ratio_ = readRatio(parameters);
}

void ElasticCoupling::doAddTorque(const StateView& state, double* torque) const {
  // T = k (phi_a - i phi_b) + c (omega_a - i omega_b)
  const double T = stiffness_ * (state.angle[a_] - ratio_ * state.angle[b_]) +
                   damping_ * (state.velocity[a_] - ratio_ * state.velocity[b_]);
  torque[a_] -= T;
  torque[b_] += ratio_ * T;
}

void ElasticCoupling::doAddTorqueRate(const StateView& state, double* torque_rate) const {
  // T' = k (omega_a - i omega_b) + c (epsilon_a - i epsilon_b)
  const double T_rate = stiffness_ * (state.velocity[a_] - ratio_ * state.velocity[b_]) +
                        damping_ * (state.acceleration[a_] - ratio_ * state.acceleration[b_]);
  torque_rate[a_] -= T_rate;
  torque_rate[b_] += ratio_ * T_rate;
}

void ElasticCoupling::doAddTorqueRateDerivatives(const StateView& /*state*/,
                                                 double* derivatives) const {
  // Q_a' = -T', Q_b' = i T'; T' depends on x_a - i x_b
  RateDerivatives d(derivatives, shaftCount());
  for (const auto& [by, factor] : {std::pair(a_, 1.0), std::pair(b_, -ratio_)}) {
    d.byVelocity(by, a_) -= factor * stiffness_;
    d.byVelocity(by, b_) += factor * ratio_ * stiffness_;
    d.byAcceleration(by, a_) -= factor * damping_;
    d.byAcceleration(by, b_) += factor * ratio_ * damping_;
  }
}

}  // namespace variator_sim
