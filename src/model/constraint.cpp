#include "variator_sim/constraint.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/central_difference.h"
#include "model/switch_guard.h"

namespace variator_sim {

namespace {

/// C of any order, by the cheapest form that gives it.
void calcJacobian(const Constraint& constraint, const StateView& state, double* C) {
  double c0;
  if (constraint.order() == 3) {
    constraint.calcRow(state, C, &c0);
  } else {
    constraint.calcResidualAndJacobian(state, C);
  }
}

}  // namespace

double Constraint::doCalcVelocityResidualAndJacobian(const StateView& state, double* C) const {
  ConstraintPartials partials;
  doCalcPartials(state, partials);
  std::copy_n(partials.velocity, shaft_count_, C);
  return doCalcResidual(state);
}

double Constraint::doCalcResidualAndJacobian(const StateView& state, double* C) const {
  ConstraintPartials partials;
  doCalcPartials(state, partials);
  if (order() == 2) {
    std::copy_n(partials.acceleration, shaft_count_, C);
    return doCalcResidual(state);
  }
  // f' = df/dt + df/dphi omega + df/domega epsilon + df/du u'
  double sum = partials.time;
  for (int i = 0; i < shaft_count_; ++i) {
    C[i] = partials.velocity[i];
    sum += partials.angle[i] * state.velocity[i] + partials.velocity[i] * state.acceleration[i];
  }
  if (readsInputs()) {
    for (int i = 0; i < kMaxInputs; ++i) {
      if (partials.input[i] != 0.0) sum += partials.input[i] * state.input_rate[i];
    }
  }
  return sum;
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

unsigned Constraint::doNonlinearAccelerations() const {
  return isLinearInAcceleration() ? 0U : (1U << static_cast<unsigned>(shaft_count_)) - 1U;
}

const std::vector<ConstraintPtr>& Constraint::doKinks() const {
  static const std::vector<ConstraintPtr> kNone;
  return kNone;
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
    calcJacobian(*this, shifted, C_above);
    acceleration[j] = below;
    calcJacobian(*this, shifted, C_below);
    acceleration[j] = state.acceleration[j];
    for (int i = 0; i < s; ++i) H[i * s + j] = (C_above[i] - C_below[i]) / (above - below);
  }
  if (order() == 3) return;
  // Second derivatives are symmetric; their differences only nearly so.
  for (int i = 0; i < s; ++i) {
    for (int j = 0; j < i; ++j) {
      const double mean = 0.5 * (H[i * s + j] + H[j * s + i]);
      H[i * s + j] = mean;
      H[j * s + i] = mean;
    }
  }
}

void Constraint::doCalcJacobianRate(const StateView& state, double* D, double* H) const {
  doCalcHessian(state, H);
  // D = (C(t + h, phi + h omega, omega + h epsilon, u + h u') - C(t - h, ...)) / 2h, epsilon held
  const int s = shaft_count_;
  double scale = 1.0;
  for (int i = 0; i < s; ++i) {
    scale = std::max({scale, std::abs(state.velocity[i]), std::abs(state.acceleration[i])});
  }
  const double h = std::cbrt(std::numeric_limits<double>::epsilon()) / scale;
  double C[2][kMaxShafts];
  for (int side = 0; side < 2; ++side) {
    const double step = side == 0 ? -h : h;
    double angle[kMaxShafts];
    double velocity[kMaxShafts];
    double input[kMaxInputs] = {};
    for (int i = 0; i < s; ++i) {
      angle[i] = state.angle[i] + step * state.velocity[i];
      velocity[i] = state.velocity[i] + step * state.acceleration[i];
    }
    StateView shifted = state;
    shifted.time += step;
    shifted.angle = angle;
    shifted.velocity = velocity;
    if (readsInputs()) {
      for (int i = 0; i < kMaxInputs; ++i) input[i] = state.input[i] + step * state.input_rate[i];
      shifted.input = input;
    }
    calcJacobian(*this, shifted, C[side]);
  }
  for (int i = 0; i < s; ++i) D[i] = (C[1][i] - C[0][i]) / (2.0 * h);
}

void Constraint::doCalcRowDerivatives(const StateView& state, double* dC, double* dc0) const {
  const int s = shaft_count_;
  forEachShift(state, s, [&](int q, const StateView& above, const StateView& below, double width) {
    double C_above[kMaxShafts];
    double C_below[kMaxShafts];
    double c0_above;
    double c0_below;
    doCalcRow(above, C_above, &c0_above);
    doCalcRow(below, C_below, &c0_below);
    for (int i = 0; i < s; ++i) dC[q * s + i] = (C_above[i] - C_below[i]) / width;
    dc0[q] = (c0_above - c0_below) / width;
  });
}

std::vector<GuardPtr> Constraint::guards() const {
  std::vector<GuardPtr> guards = doGuards();
  addSwitchGuards(
      doSwitchCount(),
      [this](const StateView& state, double* values) { doCalcSwitches(state, values); },
      [this](int index) { return doSwitchJumps(index); }, guards);
  return guards;
}

}  // namespace variator_sim
