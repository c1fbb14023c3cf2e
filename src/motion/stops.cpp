/// Finds out why a motion stops: a law or a row of C that fails at its last state or just ahead of
/// it.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "dynamics/constraint_rows.h"
#include "dynamics/dense.h"
#include "motion/motion.h"

namespace variator_sim {

StopReason reasonOf(scene_status status) {
  // In the order of scene_status.
  constexpr StopReason kReasons[] = {StopReason::kNone,
                                     StopReason::kNonFiniteValue,
                                     StopReason::kSingularConstraint,
                                     StopReason::kProjectionFailed,
                                     StopReason::kNonFiniteValue,
                                     StopReason::kStepUnderflow,
                                     StopReason::kChattering,
                                     StopReason::kJumpFailed,
                                     StopReason::kProjectionFailed,
                                     StopReason::kNoModes,
                                     StopReason::kStepTooLarge};
  static_assert(std::size(kReasons) == SCENE_STEP_TOO_LARGE + 1);
  return kReasons[status];
}

void Motion::stop(StopReason reason, double at) {
  status.reason = reason;
  status.time = at;
}

void Motion::stop(scene_status why) {
  const Exchange& it = program.it;
  const double front = program.front();
  stop(reasonOf(why), why == SCENE_NO_MODES ? std::max(it.stopped, front) : front);
  program.leave();
  if (why == SCENE_STEP_TOO_LARGE) {
    status.measure = it.error * scene.solver.relative_tolerance;
    return;
  }
  explainStop();
  // (Of accelerations that follow from the state: those of gauss.)
  const bool is_lost = it.rounding > 1.0 && status.reason == StopReason::kStepUnderflow;
  if (!is_lost || why != SCENE_TOO_MANY_STEPS) return;
  status.reason = StopReason::kToleranceTooSmall;
  status.measure = it.rounding;
}

void Motion::explainStop() {
  const int S = scene.shaftCount();
  const double front = program.front();
  lookAtFront();
  const StateView state = program.view(program.it.state, front);
  if (quantities.isInertiaLost(state)) status.reason = StopReason::kIndefiniteInertia;
  switch (status.reason) {
    case StopReason::kChattering:
    case StopReason::kNoModes:
    case StopReason::kIndefiniteInertia:
      return;
    case StopReason::kJumpFailed:
      if (scene.constraintCount() == 1) status.constraint = 0;
      return;
    case StopReason::kNonFiniteValue:  // where a formula has no series steps end, too
      status.reason = StopReason::kStepUnderflow;
      break;
    default:
      break;
  }
  if (findBadValue(state) || findLostRow(state, 3) || findFaultAhead()) return;
  if (status.reason != StopReason::kStepUnderflow) return;
  if (doSolutionsMeet()) {
    status.reason = StopReason::kProjectionFailed;
    return;
  }
  for (int i = 0; i < (program.text().IS_CLASSICAL != 0 ? 2 : 3) * S; ++i) {
    const double rate = std::abs(slope_[i]) / std::max(1.0, std::abs(program.it.state[i]));
    status.measure = std::max(status.measure, rate);
  }
}

void Motion::lookAtFront() {
  const int S = scene.shaftCount();
  Sample unused;
  program.look(std::numeric_limits<double>::infinity(), &unused, slope_ + 2 * S);
  std::copy_n(program.it.state + S, 2 * S, slope_);
}

void Motion::goAhead(double h, double* values) const {
  const int S = scene.shaftCount();
  for (int i = 0; i < 3 * S; ++i) values[i] = program.it.state[i] + h * slope_[i];
}

double Motion::leastDistance() const {
  return 1e-14 * std::max(1.0, std::abs(program.front()));
}

bool Motion::findBadValue(StateView state) {
  const int S = scene.shaftCount();
  static constexpr double kZeros[kMaxShafts] = {};
  const auto isFinite = [S](const double* values) {
    return std::all_of(values, values + S, [](double value) { return std::isfinite(value); });
  };
  status.torque = status.constraint = -1;
  const auto blame = [this](int* culprit, std::size_t index) {
    *culprit = static_cast<int>(index);
    status.reason = StopReason::kNonFiniteValue;
    return true;
  };
  const auto findTorque = [&](void (Torque::*add)(const StateView&, double*) const) {
    for (std::size_t j = 0; j < scene.torques.size(); ++j) {
      double value[kMaxShafts] = {};
      ((*scene.torques[j]).*add)(state, value);
      if (!isFinite(value)) return blame(&status.torque, j);
    }
    return false;
  };
  // The order of dependence is Q, the accelerations, psi, Q'. A law that reads accelerations which
  // are not finite is a consequence of an earlier one.
  if (findTorque(&Torque::addTorque)) return true;
  if (!isFinite(state.acceleration)) state.acceleration = kZeros;
  for (std::size_t m = 0; m < scene.constraints.size(); ++m) {
    const Constraint& law = *scene.constraints[m];
    double C[kMaxShafts];
    double c0;
    law.calcRow(state, C, &c0);
    const bool is_finite = std::isfinite(c0) && isFinite(C) &&
                           (law.order() == 3 || std::isfinite(law.calcResidual(state)));
    if (!is_finite) return blame(&status.constraint, m);
  }
  return findTorque(&Torque::addTorqueRate);
}

bool Motion::findLostRow(const StateView& state, int highest_order) {
  const int S = scene.shaftCount();
  int which[kMaxConstraints];
  int count = 0;
  for (int m = 0; m < scene.constraintCount(); ++m) {
    if (scene.constraints[static_cast<std::size_t>(m)]->order() <= highest_order) {
      which[count++] = m;
    }
  }
  ConstraintRows rows(S, count);
  for (int n = 0; n < count; ++n) {
    double row[kMaxShafts];
    double c0;
    scene.constraints[static_cast<std::size_t>(which[n])]->calcRow(state, row, &c0);
    rows.jacobian().row(n) = DenseVector::Map(row, S);
  }
  const DenseMatrix J = quantities.calcInertia(state);
  SquareMatrix mobility(S, S);
  for (int i = 0; i < S; ++i) {
    DenseVector unit = DenseVector::Unit(S, i);
    if (!solveSymmetric(J, 0.0, &unit)) return false;
    mobility.col(i) = unit;
  }
  const auto blame = [&](int n, double measure) {
    status.reason = StopReason::kSingularConstraint;
    status.constraint = which[n];
    status.measure = measure;
    return true;
  };
  // The step underflows before the rank is lost outright: eta grows without bound near there.
  if (!rows.factor(mobility) || rows.rankLeft() < 1e-9) {
    return blame(rows.weakest(), rows.rankLeft());
  }
  for (int n = 0; n < count; ++n) {
    // If C goes to zero like sqrt(t* - t), the step underflows first, at C ~ 1e-8.
    const double left =
        std::sqrt(rows.lengthSquared(n) / std::max(program.it.longest[which[n]], 1e-300));
    if (left < 1e-5) return blame(n, left);
  }
  return false;
}

bool Motion::findFaultAhead() {
  const int S = scene.shaftCount();
  const double front = program.front();
  LeastReactionSearch* const search =
      program.text().IS_CLASSICAL != 0 ? beginning.search() : nullptr;
  double h = leastDistance();
  for (int decade = 0; decade < 12; ++decade, h *= 10.0) {
    double values[3 * kMaxShafts];
    goAhead(h, values);
    if (!std::all_of(values, values + 3 * S, [](double x) { return std::isfinite(x); }))
      return false;
    bool is_solved = true;
    if (search != nullptr) {  // the accelerations of the front are followed to there
      double multipliers[kMaxShafts] = {};
      std::copy_n(program.it.state + 2 * S, S, values + 2 * S);
      search->calcMultipliers(program.view(program.it.state, front), multipliers);
      is_solved = search->follow(program.view(values, front + h), values + 2 * S, multipliers);
    }
    if (!is_solved) std::fill_n(values + 2 * S, S, std::numeric_limits<double>::quiet_NaN());
    if (findBadValue(program.view(values, front + h))) return true;
    if (is_solved) continue;
    status.reason = StopReason::kProjectionFailed;
    return true;
  }
  return false;
}

bool Motion::doSolutionsMeet() {
  const int S = scene.shaftCount();
  // Points of stationary reaction meet where the matrix of Newton's iteration for them,
  //     [ J - sum lambda_m H_m   -C^T ]
  //     [ C                       0   ],
  // becomes singular: without H the answer d to a force J r is no longer than r.
  constexpr double kGain = 1e3;
  const int K = scene.constraintCount();
  const MotionProgram& text = program.text();
  if (text.IS_CLASSICAL == 0 || text.HOLDS > 0 || K == 0 || K >= S) return false;
  const StateView state = program.view(program.it.state, program.front());
  const DenseMatrix J = quantities.calcInertia(state);
  DenseVector r = DenseVector::Zero(S);
  for (int i = 0; i < S; ++i) r(i) = std::cos(i + 1.0);  // of no special direction
  DenseVector force = DenseVector::Zero(S + K);
  force.head(S) = J * r;
  DenseMatrix all = DenseMatrix::Zero(S + K, S + K);
  all.topLeftCorner(S, S) = J;
  for (int m = 0; m < K; ++m) {
    double C[kMaxShafts];
    double H[kMaxShafts * kMaxShafts];
    const Constraint& it = *scene.constraints[static_cast<std::size_t>(m)];
    it.calcResidualAndJacobian(state, C);
    it.calcHessian(state, H);
    for (int i = 0; i < S; ++i) {
      all(S + m, i) = C[i];
      all(i, S + m) = -C[i];
      for (int j = 0; j < S; ++j) all(i, j) -= program.it.multiplier[m] * H[i * S + j];
    }
  }
  DenseVector answer;
  if (!all.allFinite() || !solveScaled(all, force, &answer)) return false;
  const DenseVector d = answer.head(S);
  return d.dot(J * d) > kGain * kGain * r.dot(J * r);
}

}  // namespace variator_sim
