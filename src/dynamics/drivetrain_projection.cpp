#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/drivetrain.h"

namespace variator_sim {

bool Drivetrain::calcCorrection(const double* level, const double* shift, ConstraintSolver* solver,
                                double* delta) {
  double residual[kMaxRows];
  for (int r = 0; r < solver->rowCount(); ++r) {
    residual[r] = *level++;
    for (int i = 0; i < S; ++i) solver->row(r)[i] = level[i];
    for (int i = 0; shift != nullptr && i < S; ++i) residual[r] += level[i] * shift[i];
    level += S;
  }
  return withShaftCount(S, [&](auto shafts) {
    if (!solver->factor(shafts, inertia_)) return false;
    for (int r = 0; r < solver->rowCount(); ++r) residual[r] = -residual[r];
    solver->solve(residual, residual);
    for (int i = 0; i < shafts; ++i) delta[i] = 0.0;
    solver->addReaction(shafts, residual, delta);
    return true;
  });
}

template <class Evaluate>
void Drivetrain::addProjectionRounding(const StateView& state, const ConstraintSolver& solver,
                                       double* rounding, Evaluate evaluate) const {
  constexpr double kUlps = 8.0 * std::numeric_limits<double>::epsilon();
  const int k = solver.rowCount();
  if (k == 0) return;
  // The residuals of all rows are read at once: a level's program has no single ones.
  const auto read = [&](const StateView& at, double* residual) {
    const double* const level = evaluate(at);
    for (int r = 0; r < k; ++r) residual[r] = level[r * (S + 1)];
  };
  double here[kMaxRows];
  double there[kMaxRows];
  double noise[kMaxRows];
  read(state, here);
  for (int r = 0; r < k; ++r) noise[r] = kUlps * std::abs(here[r]);
  StateView beside = state;
  const auto addChange = [&] {
    read(beside, there);
    for (int r = 0; r < k; ++r) noise[r] += std::abs(there[r] - here[r]);
  };
  beside.time = state.time * (1.0 + kUlps);
  addChange();
  // sin(t + 1e8) has an argument known to 1e-8: second differences measure this roughness.
  double bend[kMaxRows] = {};
  for (const double part : {1e-7, 6.18e-8, 3.82e-8, 2.36e-8}) {
    double before[kMaxRows];
    beside.time = state.time + part;
    read(beside, there);
    beside.time = state.time - part;
    read(beside, before);
    for (int r = 0; r < k; ++r) {
      bend[r] = std::max(bend[r], std::abs(there[r] + before[r] - 2.0 * here[r]));
    }
  }
  for (int r = 0; r < k; ++r) noise[r] += 2.0 * bend[r];
  beside.time = state.time;
  double shifted[kMaxShafts];
  for (const double* StateView::*part :
       {&StateView::angle, &StateView::velocity, &StateView::acceleration}) {
    std::copy_n(state.*part, S, shifted);
    beside.*part = shifted;
    for (int i = 0; i < S; ++i) {
      shifted[i] = (state.*part)[i] * (1.0 + kUlps);
      addChange();
      shifted[i] = (state.*part)[i];
    }
    beside.*part = state.*part;
  }
  for (int r = 0; r < k; ++r) {
    double l[kMaxRows] = {};
    double moved[kMaxShafts] = {};
    l[r] = noise[r];
    solver.solve(l, l);
    solver.addReaction(l, moved);
    for (int i = 0; i < S; ++i) rounding[i] += std::abs(moved[i]);
  }
}

bool Drivetrain::calcVelocityProjection(const StateView& state, double* delta) {
  const double* const level = program_.calcVelocityLevel(state);
  return calcCorrection(level, nullptr, &velocity_solver_, delta);
}

bool Drivetrain::calcAccelerationProjection(const StateView& state, double* delta) {
  const double* const level = program_.calcAccelerationLevel(state);
  return calcCorrection(level, nullptr, &acceleration_solver_, delta);
}

bool Drivetrain::calcStiffProjection(const StateView& state, double h, double* delta) {
  constexpr int kMax = kMaxRows;
  const int k = static_cast<int>(acceleration_rows_.size());
  double rows[kMax][2 * kMaxShafts];      // (B, C)
  double weighted[kMax][2 * kMaxShafts];  // (h^2 B J^-1, C J^-1)
  double scale[kMax] = {};
  DenseVector l(k);
  for (int r = 0; r < k; ++r) {
    const Constraint& constraint = *constraints_[acceleration_rows_[r]];
    ConstraintPartials partials;
    constraint.calcPartials(state, partials);
    std::copy_n(partials.velocity, S, rows[r]);
    std::copy_n(partials.acceleration, S, rows[r] + S);
    inertia_.solve(rows[r], weighted[r]);
    inertia_.solve(rows[r] + S, weighted[r] + S);
    double length = 0.0;
    for (int i = 0; i < S; ++i) weighted[r][i] *= h * h;
    for (int i = 0; i < 2 * S; ++i) length += rows[r][i] * weighted[r][i];
    // Rows of length 1 make the matrix independent of the units of psi.
    scale[r] = 1.0 / std::sqrt(length);
    l(r) = constraint.calcResidual(state) * scale[r];
  }
  if (k == 1) {
    if (!std::isfinite(scale[0])) return false;
  } else {
    DenseMatrix A(k, k);
    for (int r = 0; r < k; ++r) {
      for (int n = 0; n < k; ++n) {
        double entry = 0.0;
        for (int i = 0; i < 2 * S; ++i) entry += rows[r][i] * weighted[n][i];
        A(r, n) = entry * scale[r] * scale[n];
      }
    }
    if (!solveSymmetric(A, ConstraintSolver::kRankTolerance, &l)) return false;
  }
  for (int i = 0; i < 2 * S; ++i) {
    delta[i] = 0.0;
    for (int r = 0; r < k; ++r) delta[i] -= weighted[r][i] * scale[r] * l(r);
  }
  return true;
}

bool Drivetrain::calcLinearizedReaction(const StateView& state, const double* free, double* delta) {
  double shift[kMaxShafts];
  for (int i = 0; i < S; ++i) shift[i] = free[i] - state.acceleration[i];
  const double* const level = program_.calcAccelerationLevel(state);
  return calcCorrection(level, shift, &acceleration_solver_, delta);
}

void Drivetrain::calcProjectionRounding(const StateView& state, double* velocity,
                                        double* acceleration) {
  std::fill_n(velocity, S, 0.0);
  std::fill_n(acceleration, S, 0.0);
  addProjectionRounding(state, velocity_solver_, velocity,
                        [&](const StateView& at) { return program_.calcVelocityLevel(at); });
  addProjectionRounding(state, acceleration_solver_, acceleration,
                        [&](const StateView& at) { return program_.calcAccelerationLevel(at); });
}

bool Drivetrain::calcJumpRate(const StateView& state, const double* torque_jump,
                              const double* input_jump, double* rate) {
  inertia_.solve(torque_jump, rate);
  if (constraintCount() == 0) return true;
  double c0[kMaxRows] = {};
  for (int m = 0; m < constraintCount(); ++m) {
    double unused;
    const Constraint& row = constraint(m);
    if (row.order() == 3) {
      row.calcRow(state, solver_.row(m), &unused);
    } else {
      row.calcResidualAndJacobian(state, solver_.row(m));
    }
    c0[m] = 0.0;
    if (row.readsInputs()) {
      ConstraintPartials partials;
      row.calcPartials(state, partials);
      for (int i = 0; i < inputCount(); ++i) c0[m] += partials.input[i] * input_jump[i];
    }
  }
  if (!solver_.factor(inertia_)) {
    for (int i = 0; i < S; ++i) rate[i] = std::numeric_limits<double>::quiet_NaN();
    return false;
  }
  double Lambda[kMaxRows] = {};
  solver_.constrain(c0, rate, Lambda);
  return true;
}

bool Drivetrain::calcKinkJump(StateView before, StateView after, double* change) {
  const double* begin = after.acceleration;
  const int k = constraintCount();
  double at[kMaxShafts];
  const auto slope = [&](double theta, const double* moved, double* rate) {
    double C[kMaxShafts];
    double gap[kMaxRows] = {};
    for (int i = 0; i < S; ++i) at[i] = begin[i] + moved[i];
    before.acceleration = after.acceleration = at;
    for (int m = 0; m < k; ++m) {
      const Constraint& row = constraint(m);
      double* mean = solver_.row(m);
      double unused = 0.0;
      if (row.order() == 3) {
        row.calcRow(before, C, &unused);
        row.calcRow(after, mean, &unused);
      } else {
        gap[m] = -row.calcResidualAndJacobian(before, C);
        gap[m] += row.calcResidualAndJacobian(after, mean);
      }
      for (int i = 0; i < S; ++i) mean[i] = (1.0 - theta) * C[i] + theta * mean[i];
    }
    double Lambda[kMaxRows] = {};
    std::fill_n(rate, S, 0.0);
    if (!solver_.factor(inertia_)) return false;
    solver_.constrain(gap, rate, Lambda);
    return true;
  };
  // Steps of the classical Runge-Kutta method, as nothing here is stiff; one step is exact if C
  // does not rotate.
  constexpr int kSteps = 200;
  constexpr double kTurned = 1e-12;
  double k1[kMaxShafts];
  double k2[kMaxShafts];
  double k3[kMaxShafts];
  double k4[kMaxShafts];
  double e[kMaxShafts];
  std::fill_n(change, S, 0.0);
  if (!slope(0.0, change, k1) || !slope(1.0, k1, k4)) return false;
  double largest = 0.0;
  double turn = 0.0;
  for (int i = 0; i < S; ++i) {
    largest = std::max(largest, std::abs(k1[i]));
    turn = std::max(turn, std::abs(k4[i] - k1[i]));
  }
  const int steps = turn > kTurned * largest ? kSteps : 1;
  const double h = 1.0 / steps;
  for (int n = 0; n < steps; ++n) {
    const double theta = n * h;
    if (!slope(theta, change, k1)) return false;
    for (int i = 0; i < S; ++i) e[i] = change[i] + 0.5 * h * k1[i];
    if (!slope(theta + 0.5 * h, e, k2)) return false;
    for (int i = 0; i < S; ++i) e[i] = change[i] + 0.5 * h * k2[i];
    if (!slope(theta + 0.5 * h, e, k3)) return false;
    for (int i = 0; i < S; ++i) e[i] = change[i] + h * k3[i];
    if (!slope(theta + h, e, k4)) return false;
    for (int i = 0; i < S; ++i) change[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
  }
  return true;
}

bool Drivetrain::calcFormalJumpRate(const StateView& state, const double* torque_jump,
                                    const double* input_jump, double* rate) {
  if (!calcJumpRate(state, torque_jump, input_jump, rate)) return false;
  double torque[kMaxShafts];
  double reaction[kMaxShafts];
  double lambda[kMaxRows] = {};
  double c0[kMaxRows] = {};
  calcTorque(state, torque);
  calcReaction(state, torque, reaction);
  calcMultipliers(reaction, lambda);
  for (int m = 0; m < constraintCount(); ++m) {
    constraint(m).calcHessian(state, hessian(m));
    // calcJumpRate has just made C d_epsilon = -dpsi/du Delta_u.
    for (int i = 0; i < S; ++i) c0[m] -= solver_.row(m)[i] * rate[i];
  }
  if (solveFormal(lambda, torque_jump, c0, rate)) return true;
  for (int i = 0; i < S; ++i) rate[i] = std::numeric_limits<double>::quiet_NaN();
  return false;
}

}  // namespace variator_sim
