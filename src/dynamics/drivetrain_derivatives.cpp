#include <algorithm>
#include <limits>

#include "dynamics/drivetrain.h"
#include "dynamics/shaft_count.h"
#include "dynamics/torque_tangent.h"
#include "model/central_difference.h"

namespace variator_sim {

template <class Count>
bool Drivetrain::projectResidual(Count shafts, const double* level, const double* P0,
                                 const double* D0, double* v, double* residual) {
  const int k = constraintCount();
  double psi[kMaxRows];
  if (k == 1) {
    // Local variables avoid the store and load latency of the solver's memory.
    const double* const C = level + 1;
    double w[kMaxShafts];
    inertia_.solve(shafts, C, w);
    double A = 0.0;
    double right = 0.0;
    for (int i = 0; i < shafts; ++i) {
      A += C[i] * w[i];
      right += C[i] * v[i];
    }
    if (!(A > 0.0)) return false;
    const double l = right / A;
    for (int i = 0; i < shafts; ++i) v[i] -= w[i] * l;
    psi[0] = level[0];
  } else {
    double l[kMaxRows];
    for (int m = 0; m < k; ++m) {
      psi[m] = *level++;
      for (int i = 0; i < shafts; ++i) solver_.row(m)[i] = level[i];
      level += shafts;
    }
    if (!solver_.factor(shafts, inertia_)) return false;
    constexpr double kZeros[kMaxRows] = {};
    solver_.constrain(shafts, kZeros, v, l);
  }
  for (int i = 0; i < shafts; ++i) {
    residual[i] = 0.0;
    for (int j = 0; j < shafts; ++j) residual[i] += P0[i + j * shafts] * v[j];
    for (int m = 0; m < k; ++m) residual[i] += D0[i + m * shafts] * psi[m];
  }
  return true;
}

bool Drivetrain::calcStageResidual(const StateView& state, const double* eta,
                                   const SquareMatrix& P0, const SquareMatrix& D0,
                                   double* residual) {
  return withShaftCount(S, [&](auto shafts) {
    double rate[kMaxShafts];
    double v[kMaxShafts];
    const double* const values = program_.calcRateAndLevel(state);
    for (int i = 0; i < shafts; ++i) rate[i] = values[i];
    makeCovariant(state, rate);
    inertia_.solve(shafts, rate, v);
    for (int i = 0; i < shafts; ++i) v[i] = eta[i] - v[i];
    return projectResidual(shafts, values + shafts, P0.data(), D0.data(), v, residual);
  });
}

void Drivetrain::calcStageDerivatives(const StateView& state, const double* Lambda,
                                      SquareMatrix& projector, SquareMatrix& pull,
                                      double* derivatives) {
  double rates[3 * kMaxShafts * kMaxShafts];
  double psi_q[3 * kMaxShafts][kMaxRows];
  std::fill_n(rates, 3 * S * S, 0.0);
  if (program_.hasPartials()) {
    addPartials(state, Lambda, rates, psi_q);
  } else {
    for (const Torque* torque : torques_) torque->addTorqueRateDerivatives(state, rates);
    addRowDerivatives(state, Lambda, rates, psi_q);
  }
  calcProjected(rates, psi_q, projector, pull, derivatives);
}

bool Drivetrain::calcAccelerationResidual(const StateView& state, const SquareMatrix& P0,
                                          const SquareMatrix& D0, double* residual) {
  return withShaftCount(S, [&](auto shafts) {
    double torque[kMaxShafts];
    double v[kMaxShafts];
    calcFreeTorque(state, torque);
    inertia_.solve(shafts, torque, v);
    for (int i = 0; i < shafts; ++i) v[i] = state.acceleration[i] - v[i];
    return projectResidual(shafts, program_.calcAccelerationLevel(state), P0.data(), D0.data(), v,
                           residual);
  });
}

void Drivetrain::calcAccelerationDerivatives(const StateView& state, const double* lambda,
                                             SquareMatrix& projector, SquareMatrix& pull,
                                             double* derivatives) {
  const int directions = 2 * S;
  double torques[3 * kMaxShafts * kMaxShafts];
  double psi_q[3 * kMaxShafts][kMaxRows];
  std::fill_n(torques, 3 * S * S, 0.0);
  const TorqueTangent tangent(*this, state);
  const auto differentiate = [&](int q, const StateView& above, const StateView& below,
                                 double width) {
    if (q >= directions) return;
    double upper[kMaxShafts];
    double lower[kMaxShafts];
    tangent.calcTorque(above, upper);
    tangent.calcTorque(below, lower);
    for (int i = 0; i < S; ++i) torques[q * S + i] = (upper[i] - lower[i]) / width;
  };
  forEachShift(state, S, differentiate, naturalSize());
  addRowDerivatives(state, lambda, torques, psi_q);
  double all[3 * kMaxShafts * kMaxShafts];
  calcProjected(torques, psi_q, projector, pull, all);
  std::copy_n(all, directions * S, derivatives);
}

void Drivetrain::calcJerkDerivatives(const StateView& state, const double* eta,
                                     const double* Lambda, double* derivatives) const {
  std::fill_n(derivatives, 3 * S * S, 0.0);
  for (const Torque* torque : torques_) torque->addTorqueRateDerivatives(state, derivatives);
  double right[3 * kMaxShafts][kMaxRows];
  withShaftCount(S, [&](auto shafts) {
    const int directions = 3 * shafts;
    for (int m = 0; m < constraintCount(); ++m) {
      double dC[3 * kMaxShafts * kMaxShafts];
      double dc0[3 * kMaxShafts];
      constraint(m).calcRowDerivatives(state, dC, dc0);
      for (int q = 0; q < directions; ++q) {
        double sum = dc0[q];
        for (int i = 0; i < shafts; ++i) {
          sum += dC[q * shafts + i] * eta[i];
          derivatives[q * shafts + i] += dC[q * shafts + i] * Lambda[m];
        }
        right[q][m] = sum;
      }
    }
    for (int q = 0; q < directions; ++q) {
      double rate[kMaxShafts];
      double* eta_q = derivatives + q * shafts;
      for (int i = 0; i < shafts; ++i) rate[i] = eta_q[i];
      inertia_.solve(shafts, rate, eta_q);
      double Lambda_q[kMaxRows];
      if (constraintCount() > 0) solver_.constrain(shafts, right[q], eta_q, Lambda_q);
    }
  });
}

void Drivetrain::addPartials(const StateView& state, const double* Lambda, double* rates,
                             double (*psi_q)[kMaxRows]) {
  using Kind = SceneProgram::Partial::Kind;
  for (int q = 0; q < 3 * S; ++q) std::fill_n(psi_q[q], constraintCount(), 0.0);
  const double* value = program_.calcPartials(state);
  for (const SceneProgram::Partial& it : program_.partials()) {
    switch (it.kind) {
      case Kind::kRate:
        rates[it.q * S + it.i] += *value;
        break;
      case Kind::kEntry:
        rates[it.q * S + it.i] += *value * Lambda[it.m];
        break;
      case Kind::kResidual:
        psi_q[it.q][it.m] = *value;
        break;
    }
    ++value;
  }
  for (int m = 0; m < constraintCount(); ++m) {
    for (int j = 0; j < S; ++j) solver_.row(m)[j] = psi_q[2 * S + j][m];
  }
}

void Drivetrain::addRowDerivatives(const StateView& state, const double* Lambda, double* rates,
                                   double (*psi_q)[kMaxRows]) {
  const int directions = 3 * S;
  for (int m = 0; m < constraintCount(); ++m) {
    double dC[3 * kMaxShafts * kMaxShafts];
    double dc0[3 * kMaxShafts];
    ConstraintPartials partials;
    constraint(m).calcRowDerivatives(state, dC, dc0);
    constraint(m).calcPartials(state, partials);
    for (int j = 0; j < S; ++j) {
      psi_q[j][m] = partials.angle[j];
      psi_q[S + j][m] = partials.velocity[j];
      psi_q[2 * S + j][m] = partials.acceleration[j];
      solver_.row(m)[j] = partials.acceleration[j];
    }
    for (int n = 0; n < directions * S; ++n) rates[n] += dC[n] * Lambda[m];
  }
}

void Drivetrain::calcProjected(const double* rates, const double (*psi_q)[kMaxRows],
                               SquareMatrix& projector, SquareMatrix& pull, double* derivatives) {
  const int directions = 3 * S;
  if (!solver_.factor(inertia_)) {
    projector.fill(std::numeric_limits<double>::quiet_NaN());
    return;
  }
  withShaftCount(S, [&](auto shafts) {
    // x + D (y - C x): the part of x in the null space of C, plus D y
    const auto combine = [&](double* x, const double* y) {
      double l[kMaxRows] = {};
      solver_.multiply(shafts, x, l);
      for (int m = 0; m < constraintCount(); ++m) l[m] = y[m] - l[m];
      solver_.solve(l, l);
      solver_.addReaction(shafts, l, x);
    };
    const double zeros[kMaxRows] = {};
    for (int j = 0; j < shafts; ++j) {
      double column[kMaxShafts] = {};
      column[j] = 1.0;
      combine(column, zeros);
      for (int i = 0; i < shafts; ++i) projector(i, j) = column[i];
    }
    for (int m = 0; m < constraintCount(); ++m) {
      double column[kMaxShafts] = {};
      double unit[kMaxRows] = {};
      unit[m] = 1.0;
      combine(column, unit);
      for (int i = 0; i < shafts; ++i) pull(i, m) = column[i];
    }
    for (int q = 0; q < directions; ++q) {
      double* column = derivatives + q * shafts;
      inertia_.solve(shafts, rates + q * shafts, column);
      for (int i = 0; i < shafts; ++i) column[i] = -column[i];
      combine(column, psi_q[q]);
    }
  });
}

}  // namespace variator_sim
