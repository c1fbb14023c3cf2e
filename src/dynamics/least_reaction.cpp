#include "dynamics/least_reaction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace variator_sim {

bool LeastReactionSolver::solve(const StateView& given, unsigned corner, double* epsilon,
                                double* multipliers) {
  select(corner);
  if (row_count_ > S) return false;
  StateView state = given;
  state.acceleration = epsilon;
  Eigen::Map<Vector> at(epsilon, S);
  Eigen::Map<Vector> lambda(multipliers, row_count_);
  Vector step;
  if (!calcStep(state, epsilon, multipliers, &step)) return false;
  // Near equilibrium epsilon is the small difference of large terms; this is what they round to.
  const double rounding = std::max(1e-290, 64.0 * std::numeric_limits<double>::epsilon() *
                                               constraints_.free().cwiseAbs().maxCoeff());
  // (Across a kink it may never get shorter.)
  const int most_halvings = constraints_.kinks().empty() ? 40 : 10;
  for (int iteration = 0; iteration < 200; ++iteration) {
    const double length = calcLength(step);
    // Natural monotonicity (Deuflhard): the next step, which does not depend on how the equations
    // are scaled, must be shorter; halve otherwise.
    double fraction = 1.0;
    const Vector epsilon_old = at;
    const Vector multipliers_old = lambda;
    Vector next;
    bool shorter = false;
    for (int halving = 0; halving < most_halvings && !shorter; ++halving, fraction *= 0.5) {
      at = epsilon_old + fraction * step.head(S);
      lambda = multipliers_old + fraction * step.tail(row_count_);
      if (!calcStep(state, epsilon, multipliers, &next)) continue;
      shorter =
          calcLength(next) <= (1.0 - 0.25 * fraction) * length || isSmall(next, epsilon, rounding);
    }
    if (!shorter) {
      // The rounding of psi's terms may keep a correction from getting shorter.
      if (!(length <= constraints_.calcRounding(state))) return false;
      next.setZero(S + row_count_);
    }
    if (isSmall(next, epsilon, rounding)) {
      // The last correction is below what can be told apart; make it, and polish psi alone.
      at += next.head(S);
      lambda += next.tail(row_count_);
      if (corner != 0) return true;
      return project(state, epsilon) && isConsistent(state);
    }
    step = next;
  }
  return false;
}

bool LeastReactionSolver::project(const StateView& state, double* epsilon) {
  constexpr int kMostIterations = 25;
  // Newton converges quadratically: after a correction of 1e-8 of the values' size the next one
  // would be lost in rounding (1e-16), so it is not made.
  constexpr double kEnough = 1e-8;
  Eigen::Map<Vector> at(epsilon, S);
  double previous = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    Vector delta(S);
    if (!constraints_.calcCorrection(state, delta.data())) return false;
    at += delta;
    if (!at.allFinite()) return false;
    const double size = delta.cwiseAbs().maxCoeff();
    const double length = at.cwiseAbs().maxCoeff();
    if (size <= kEnough * length || size == 0.0) return true;
    // Rounding can keep the corrections from shrinking below kEnough when the values are tiny.
    if (iteration > 2 && size >= 0.5 * previous) return size <= 1e-6 * (length + 1.0);
    previous = size;
  }
  return false;
}

bool LeastReactionSolver::retract(const StateView& state, double* epsilon) {
  const Vector given = Eigen::Map<const Vector>(epsilon, S);
  Eigen::Map<Vector> at(epsilon, S);
  if (project(state, epsilon) && isConsistent(state)) return true;
  // Full steps may run to and fro over a kink or away: only those that make psi less.
  at = given;
  Vector delta(S);
  if (!constraints_.calcCorrection(state, delta.data())) return false;
  const int k = constraints_.rowCount();
  double weight[kMaxConstraints] = {};
  for (int r = 0; r < k; ++r) weight[r] = 1.0 / constraints_.rowLengthSquared(r);
  const auto measure = [&] {
    double sum = 0.0;
    for (int r = 0; r < k; ++r) {
      const double psi = constraints_.row(r).calcResidual(state);
      sum += weight[r] * psi * psi;
    }
    return sum;
  };
  double left = measure();
  bool is_less = true;
  for (int iteration = 0; iteration < 40 && is_less; ++iteration) {
    if (isConsistent(state, 1e-3 * kConsistent)) break;
    if (!constraints_.calcCorrection(state, delta.data())) return false;
    const Vector old = at;
    is_less = false;
    double fraction = 1.0;
    for (int halving = 0; halving < 12 && !is_less; ++halving, fraction *= 0.5) {
      at = old + fraction * delta;
      const double now = measure();
      is_less = now <= (1.0 - 0.2 * fraction) * left;
      if (is_less) left = now;
    }
  }
  if (!isConsistent(state)) return false;
  // (Where C vanishes psi is small near by, and zero nowhere near.)
  for (int r = 0; r < k; ++r) {
    if (!(constraints_.rowLengthSquared(r) * weight[r] > kVanished)) return false;
  }
  return true;
}

bool LeastReactionSolver::isConsistent(const StateView& state, double allowed) {
  Vector delta(S);
  if (!constraints_.calcCorrection(state, delta.data())) return false;
  if (!delta.allFinite()) return false;
  const double distance = delta.cwiseAbs().maxCoeff();
  const Eigen::Map<const Vector> epsilon(state.acceleration, S);
  if (distance <= allowed * std::max(1.0, epsilon.cwiseAbs().maxCoeff())) return true;
  return distance <= constraints_.calcRounding(state);
}

int LeastReactionSolver::findNearestKinks(const StateView& given, const double* epsilon,
                                          int* nearest) const {
  StateView state = given;
  state.acceleration = epsilon;
  std::pair<double, int> kinks[kMostKinks];  // by their distances from epsilon
  int count = 0;
  for (const Constraint* const kink : constraints_.kinks()) {
    Vector slope(S);
    const double value = kink->calcResidualAndJacobian(state, slope.data());
    if (!std::isfinite(value)) return 0;
    kinks[count] = {value == 0.0 ? 0.0 : std::abs(value) / slope.cwiseAbs().maxCoeff(), count};
    ++count;
  }
  std::sort(kinks, kinks + count);
  count = std::min(count, kMostMeeting);
  for (int n = 0; n < count; ++n) nearest[n] = kinks[n].second;
  return count;
}

void LeastReactionSolver::select(unsigned corner) {
  row_count_ = 0;
  for (int m = 0; m < constraints_.rowCount(); ++m) rows_[row_count_++] = &constraints_.row(m);
  for (std::size_t j = 0; j < constraints_.kinks().size(); ++j) {
    if (!contains(corner, static_cast<int>(j))) continue;
    if (row_count_ < S) rows_[row_count_] = constraints_.kinks()[j];
    ++row_count_;
  }
}

bool LeastReactionSolver::calcStep(const StateView& state, const double* epsilon,
                                   const double* multipliers, Vector* step) {
  //  [ J - sum lambda_m H_m   -C^T ] [d epsilon]     [ J epsilon + n - Q - C^T lambda ]
  //  [ C                       0   ] [d lambda ] = - [ psi                            ]
  Matrix K = Matrix::Zero(S + row_count_, S + row_count_);
  K.topLeftCorner(S, S) = constraints_.inertia();
  Vector right(S + row_count_);
  Vector force =  // J epsilon + n - Q - C^T lambda
      constraints_.inertia() * Eigen::Map<const Vector>(epsilon, S) - constraints_.torque();
  for (int m = 0; m < row_count_; ++m) {
    Vector C(S);
    double H[kMaxShafts * kMaxShafts];
    right(S + m) = -rows_[m]->calcResidualAndJacobian(state, C.data());
    rows_[m]->calcHessian(state, H);  // symmetric
    K.row(S + m).head(S) = C;
    K.col(S + m).head(S) = -C;
    K.topLeftCorner(S, S) -= multipliers[m] * Eigen::Map<const Eigen::MatrixXd>(H, S, S);
    force -= C * multipliers[m];
  }
  right.head(S) = -force;
  return solveScaled(K, right, step);
}

bool LeastReactionSolver::isSmall(const Vector& step, const double* epsilon,
                                  double rounding) const {
  const double scale = Eigen::Map<const Vector>(epsilon, S).cwiseAbs().maxCoeff();
  // Quadratic convergence: the step after one of 1e-9 is lost in rounding.
  return calcLength(step) <= std::max(1e-9 * scale, rounding);
}

}  // namespace variator_sim
