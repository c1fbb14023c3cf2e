#include "variator_sim/constraint.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

double Constraint::doCalcResidualAndJacobian(const StateView& state, double* C) const {
  ConstraintPartials partials;
  doCalcPartials(state, partials);
  std::copy_n(partials.acceleration, shaft_count_, C);
  return doCalcResidual(state);
}

void Constraint::doCalcRow(const StateView& state, double* C, double* c0) const {
  ConstraintPartials partials;
  doCalcPartials(state, partials);
  // c0 = dpsi/dt + dpsi/dphi omega + dpsi/domega epsilon + dpsi/du u'
  double sum = partials.time;
  for (int i = 0; i < shaft_count_; ++i) {
    C[i] = partials.acceleration[i];
    sum += partials.angle[i] * state.velocity[i] + partials.velocity[i] * state.acceleration[i];
  }
  if (readsInputs()) {
    // The view has no more rates than the scene has inputs; those psi does not read are not
    // touched.
    for (int i = 0; i < kMaxInputs; ++i) {
      if (partials.input[i] != 0.0) sum += partials.input[i] * state.input_rate[i];
    }
  }
  *c0 = sum;
}

void Constraint::doCalcInputJacobian(const StateView& state, int input_count, double* Cu) const {
  ConstraintPartials partials;
  if (readsInputs()) doCalcPartials(state, partials);
  std::copy_n(partials.input, input_count, Cu);
}

void Constraint::doCalcHessian(const StateView& state, double* H) const {
  const int s = shaft_count_;
  std::fill_n(H, s * s, 0.0);
  if (isLinearInAcceleration()) return;
  // dC/depsilon_j = (C(epsilon_j + h) - C(epsilon_j - h)) / 2h, column by column
  const double relative_step = std::cbrt(std::numeric_limits<double>::epsilon());
  double acceleration[kMaxShafts];
  std::copy_n(state.acceleration, s, acceleration);
  StateView shifted = state;
  shifted.acceleration = acceleration;
  for (int j = 0; j < s; ++j) {
    const double step = relative_step * std::max(1.0, std::abs(state.acceleration[j]));
    const double above = state.acceleration[j] + step;
    const double below = state.acceleration[j] - step;
    double C_above[kMaxShafts];
    double C_below[kMaxShafts];
    acceleration[j] = above;
    calcResidualAndJacobian(shifted, C_above);
    acceleration[j] = below;
    calcResidualAndJacobian(shifted, C_below);
    acceleration[j] = state.acceleration[j];
    for (int i = 0; i < s; ++i) H[i * s + j] = (C_above[i] - C_below[i]) / (above - below);
  }
  // Second derivatives are symmetric; their differences only nearly so.
  for (int i = 0; i < s; ++i) {
    for (int j = 0; j < i; ++j) {
      const double mean = 0.5 * (H[i * s + j] + H[j * s + i]);
      H[i * s + j] = mean;
      H[j * s + i] = mean;
    }
  }
}

}  // namespace variator_sim
