#include "dynamics/least_reaction.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

bool LeastReactionSolver::solve(const StateView& given, const double* torque, unsigned corner,
                                double* epsilon, double* multipliers) {
  select(corner);
  if (row_count_ > S) return false;
  StateView state = given;
  state.acceleration = epsilon;
  Vector step;
  if (!calcStep(state, torque, epsilon, multipliers, &step)) return false;
  // Near equilibrium epsilon is the small difference of large terms; this is what they round to.
  double free[kMaxShafts];
  drivetrain_.inertia().solve(torque, free);
  double rounding = 1e-290;
  for (int i = 0; i < S; ++i) {
    rounding =
        std::max(rounding, 64.0 * std::numeric_limits<double>::epsilon() * std::abs(free[i]));
  }
  // (Across a kink it may never get shorter.)
  const int most_halvings = drivetrain_.kinks().empty() ? 40 : 10;
  for (int iteration = 0; iteration < 200; ++iteration) {
    const double length = calcLength(step);
    // Natural monotonicity (Deuflhard): the next step, which does not depend on how the equations
    // are scaled, must be shorter; halve otherwise.
    double fraction = 1.0;
    double epsilon_old[kMaxShafts];
    double multipliers_old[kMaxShafts];
    std::copy_n(epsilon, S, epsilon_old);
    std::copy_n(multipliers, row_count_, multipliers_old);
    Vector next;
    bool shorter = false;
    for (int halving = 0; halving < most_halvings && !shorter; ++halving, fraction *= 0.5) {
      for (int i = 0; i < S; ++i) epsilon[i] = epsilon_old[i] + fraction * step(i);
      for (int m = 0; m < row_count_; ++m) {
        multipliers[m] = multipliers_old[m] + fraction * step(S + m);
      }
      if (!calcStep(state, torque, epsilon, multipliers, &next)) continue;
      shorter =
          calcLength(next) <= (1.0 - 0.25 * fraction) * length || isSmall(next, epsilon, rounding);
    }
    if (!shorter) {
      // The rounding of psi's terms may keep a correction from getting shorter.
      if (!(length <= calcRounding(state))) return false;
      next.setZero(S + row_count_);
    }
    if (isSmall(next, epsilon, rounding)) {
      // The last correction is below what can be told apart; make it, and polish psi alone.
      for (int i = 0; i < S; ++i) epsilon[i] += next(i);
      for (int m = 0; m < row_count_; ++m) multipliers[m] += next(S + m);
      if (corner != 0) return true;
      double moved[kMaxShafts];
      std::uint64_t iterations = 0;
      return projectAccelerations(drivetrain_, state, epsilon, moved, &iterations) ==
                 ProjectionResult::kConverged &&
             (drivetrain_.nonlinearAccelerations() == 0 || isConsistent(state));
    }
    step = next;
  }
  return false;
}

bool LeastReactionSolver::continueFrom(const StateView& given, const double* torque,
                                       double* epsilon, double* multipliers, unsigned* corner) {
  *corner = 0;
  if (drivetrain_.kinks().empty()) return solve(given, torque, 0, epsilon, multipliers);
  Point best{};
  double guess_multipliers[kMaxShafts];
  std::copy_n(epsilon, S, best.epsilon);
  std::copy_n(multipliers, S, guess_multipliers);
  KinkValues before;
  if (!calcKinks(given, epsilon, &before)) return false;
  const auto solveFrom = [&](unsigned set, const double* start, Point* point) {
    std::copy_n(start, S, point->epsilon);
    std::copy_n(guess_multipliers, S, point->multipliers);
    point->corner = set;
    return solve(given, torque, set, point->epsilon, point->multipliers);
  };
  const auto accept = [&](const Point& point) {
    std::copy_n(point.epsilon, S, epsilon);
    std::copy_n(point.multipliers, S, multipliers);
    *corner = point.corner;
    return true;
  };
  const unsigned on = before.zeros();
  Point point;
  if (solveFrom(on, before.epsilon, &point)) {
    KinkValues after;
    if (on != 0 && isLeastAtCorner(given, torque, point)) return accept(point);
    if (on == 0 && calcKinks(given, point.epsilon, &after) && after.sides == before.sides) {
      return accept(point);
    }
  }
  // A kink was met or left: the nearest of the points that are the least on all of their sides.
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&] {
    double distance = 0.0;
    for (int i = 0; i < S; ++i) {
      distance = std::max(distance, std::abs(point.epsilon[i] - before.epsilon[i]));
    }
    if (!(distance < least)) return;
    least = distance;
    best = point;
  };
  if (solveFrom(0, before.epsilon, &point)) consider();
  forEachCorner(before, [&](unsigned set) {
    if (!solveFrom(set, before.epsilon, &point)) return;
    if (isLeastAtCorner(given, torque, point)) {
      consider();
      return;
    }
    KinkValues there;
    if (!calcKinks(given, point.epsilon, &there)) return;
    forEachPattern(set, [&](unsigned above) {
      double aside[kMaxShafts];
      moveAside(there, set, above, aside);
      if (solveFrom(0, aside, &point)) consider();
    });
  });
  return std::isfinite(least) && accept(best);
}

bool LeastReactionSolver::calcJerk(const StateView& state, unsigned corner,
                                   const double* multipliers, double* eta, double* reaction_rate) {
  select(corner);
  if (row_count_ > S) return false;
  const int n = S + row_count_;
  Matrix K = Matrix::Zero(n, n);
  Vector right = Vector::Zero(n);
  double rate[kMaxShafts];
  drivetrain_.calcFreeTorqueRate(state, rate);
  for (int i = 0; i < S; ++i) {
    right(i) = rate[i];
    for (int j = 0; j < S; ++j) K(i, j) = drivetrain_.inertia().entry(i, j);
  }
  for (int m = 0; m < row_count_; ++m) {
    double C[kMaxShafts];
    double D[kMaxShafts];
    double H[kMaxShafts * kMaxShafts];
    double c0;
    rows_[m]->calcRow(state, C, &c0);
    rows_[m]->calcJacobianRate(state, D, H);
    right(S + m) = -c0;
    for (int i = 0; i < S; ++i) {
      K(S + m, i) = C[i];
      K(i, S + m) = -C[i];
      right(i) += multipliers[m] * D[i];
      for (int j = 0; j < S; ++j) K(i, j) -= multipliers[m] * H[i * S + j];
    }
  }
  Vector solution;
  if (!solveScaled(K, right, 0, &solution)) return false;
  for (int i = 0; i < S; ++i) eta[i] = solution(i);
  drivetrain_.inertia().multiply(eta, reaction_rate);
  for (int i = 0; i < S; ++i) reaction_rate[i] -= rate[i];
  return true;
}

bool LeastReactionSolver::retract(const StateView& state, double* epsilon) {
  double given[kMaxShafts];
  double moved[kMaxShafts];
  std::uint64_t iterations = 0;
  std::copy_n(epsilon, S, given);
  if (projectAccelerations(drivetrain_, state, epsilon, moved, &iterations) ==
          ProjectionResult::kConverged &&
      isConsistent(state)) {
    return true;
  }
  // Full steps may run to and fro over a kink or away: only those that make psi less.
  std::copy_n(given, S, epsilon);
  double delta[kMaxShafts];
  if (!drivetrain_.calcAccelerationProjection(state, delta)) return false;
  double weight[kMaxRows] = {};
  const std::vector<int>& rows = drivetrain_.accelerationRows();
  const int k = static_cast<int>(rows.size());
  for (int r = 0; r < k; ++r) weight[r] = 1.0 / drivetrain_.accelerationRowLengthSquared(r);
  const auto measure = [&] {
    double sum = 0.0;
    for (int r = 0; r < k; ++r) {
      double C[kMaxShafts];
      const double psi = drivetrain_.constraint(rows[r]).calcResidualAndJacobian(state, C);
      sum += weight[r] * psi * psi;
    }
    return sum;
  };
  // (Where C vanishes psi is small near by, and zero nowhere near.)
  const auto isRegular = [&] {
    bool is_regular = true;
    for (int r = 0; r < k; ++r) {
      is_regular =
          is_regular && drivetrain_.accelerationRowLengthSquared(r) * weight[r] > kVanished;
    }
    return is_regular;
  };
  double left = measure();
  for (int iteration = 0; iteration < 40; ++iteration) {
    if (isConsistent(state, 1e-3 * kConsistent)) return isRegular();
    if (!drivetrain_.calcAccelerationProjection(state, delta)) return false;
    std::copy_n(epsilon, S, given);
    bool less = false;
    double fraction = 1.0;
    for (int halving = 0; halving < 12 && !less; ++halving, fraction *= 0.5) {
      for (int i = 0; i < S; ++i) epsilon[i] = given[i] + fraction * delta[i];
      const double now = measure();
      less = now <= (1.0 - 0.2 * fraction) * left;
      if (less) left = now;
    }
    if (!less) break;
  }
  return isConsistent(state) && isRegular();
}

bool LeastReactionSolver::isConsistent(const StateView& state, double allowed) {
  double delta[kMaxShafts];
  if (!drivetrain_.calcAccelerationProjection(state, delta)) return false;
  double scale = 1.0;
  double distance = 0.0;
  for (int i = 0; i < S; ++i) {
    if (!std::isfinite(delta[i])) return false;
    scale = std::max(scale, std::abs(state.acceleration[i]));
    distance = std::max(distance, std::abs(delta[i]));
  }
  return distance <= allowed * scale || distance <= calcRounding(state);
}

bool LeastReactionSolver::calcKinks(const StateView& given, const double* epsilon,
                                    KinkValues* values) const {
  const std::vector<const Constraint*>& kinks = drivetrain_.kinks();
  StateView state = given;
  state.acceleration = epsilon;
  for (int i = 0; i < S; ++i) {
    values->epsilon[i] = epsilon[i];
    values->scale = std::max(values->scale, std::abs(epsilon[i]));
  }
  values->count = static_cast<int>(kinks.size());
  for (int j = 0; j < values->count; ++j) {
    double* C = values->gradient[j];
    const double value = kinks[static_cast<std::size_t>(j)]->calcResidualAndJacobian(state, C);
    if (!std::isfinite(value)) return false;
    double length = 0.0;
    for (int i = 0; i < S; ++i) length = std::max(length, std::abs(C[i]));
    values->distance[j] = value == 0.0 ? 0.0 : std::abs(value) / length;
    if (value > 0.0) values->sides |= 1U << static_cast<unsigned>(j);
    int place = j;
    for (; place > 0 && values->distance[values->nearest[place - 1]] > values->distance[j];
         --place) {
      values->nearest[place] = values->nearest[place - 1];
    }
    values->nearest[place] = j;
  }
  return true;
}

double LeastReactionSolver::calcRounding(const StateView& state) const {
  double largest = 0.0;
  for (int m : drivetrain_.accelerationRows()) {
    const Constraint& constraint = drivetrain_.constraint(m);
    if (constraint.order() != 2) continue;
    ConstraintPartials partials;
    constraint.calcPartials(state, partials);
    double size = std::abs(partials.time * state.time);
    double A = 0.0;
    double B[kMaxShafts];
    drivetrain_.inertia().solve(partials.acceleration, B);
    for (int i = 0; i < S; ++i) {
      size += std::abs(partials.angle[i] * state.angle[i]) +
              std::abs(partials.velocity[i] * state.velocity[i]) +
              std::abs(partials.acceleration[i] * state.acceleration[i]);
      A += partials.acceleration[i] * B[i];
    }
    for (int i = 0; i < S; ++i) largest = std::max(largest, size * std::abs(B[i]) / A);
  }
  return 16.0 * std::numeric_limits<double>::epsilon() * largest;
}

void LeastReactionSolver::moveAside(const KinkValues& values, unsigned set, unsigned above,
                                    double* aside) const {
  const double length = kAside * std::max(values.scale, 1e-3);
  Matrix G(S, S);
  Vector right(S);
  int rows = 0;
  for (int j = 0; j < values.count && rows < S; ++j) {
    if ((set >> static_cast<unsigned>(j) & 1U) == 0U) continue;
    double size = 0.0;
    for (int i = 0; i < S; ++i) size = std::max(size, std::abs(values.gradient[j][i]));
    for (int i = 0; i < S; ++i) G(rows, i) = values.gradient[j][i] / size;
    right(rows) = (above >> static_cast<unsigned>(j) & 1U) != 0U ? length : -length;
    ++rows;
  }
  Matrix A = Matrix::Zero(rows, rows);
  for (int r = 0; r < rows; ++r) {
    for (int q = 0; q < rows; ++q) {
      for (int i = 0; i < S; ++i) A(r, q) += G(r, i) * G(q, i);
    }
  }
  const Vector l = solveLu(A, right.head(rows));
  for (int i = 0; i < S; ++i) aside[i] = values.epsilon[i];
  for (int r = 0; r < rows; ++r) {
    for (int i = 0; i < S; ++i) aside[i] += G(r, i) * l(r);
  }
}

bool LeastReactionSolver::isLeastAtCorner(const StateView& given, const double* torque,
                                          const Point& point) {
  KinkValues values;
  if (!calcKinks(given, point.epsilon, &values)) return false;
  double pull[kMaxShafts];  // J^-1 R
  drivetrain_.inertia().solve(torque, pull);
  double size = 0.0;
  for (int i = 0; i < S; ++i) {
    size = std::max(size, std::abs(pull[i]));
    pull[i] = point.epsilon[i] - pull[i];
    size = std::max(size, std::abs(pull[i]));
  }
  const int k = static_cast<int>(drivetrain_.accelerationRows().size());
  bool is_least = true;
  forEachPattern(point.corner, [&](unsigned above) {
    if (!is_least) return;
    double aside[kMaxShafts];
    moveAside(values, point.corner, above, aside);
    StateView state = given;
    state.acceleration = aside;
    Matrix normals(S, S);  // columns
    int count = 0;
    for (int m = 0; m < k; ++m) {
      double C[kMaxShafts];
      rowOf(m)->calcResidualAndJacobian(state, C);
      for (int i = 0; i < S; ++i) normals(i, count) = C[i];
      ++count;
    }
    for (int j = 0; j < values.count; ++j) {
      if ((point.corner >> static_cast<unsigned>(j) & 1U) == 0U) continue;
      const double sign = (above >> static_cast<unsigned>(j) & 1U) != 0U ? 1.0 : -1.0;
      for (int i = 0; i < S; ++i) normals(i, count) = sign * values.gradient[j][i];
      ++count;
    }
    Matrix A(count, count);
    Vector right(count);
    double length[kMaxShafts];
    for (int r = 0; r < count; ++r) {
      double column[kMaxShafts];
      double weighted[kMaxShafts];
      for (int i = 0; i < S; ++i) column[i] = normals(i, r);
      drivetrain_.inertia().solve(column, weighted);
      for (int q = 0; q < count; ++q) {
        A(q, r) = 0.0;
        for (int i = 0; i < S; ++i) A(q, r) += normals(i, q) * weighted[i];
      }
      length[r] = std::sqrt(A(r, r));
      right(r) = 0.0;
      for (int i = 0; i < S; ++i) right(r) += normals(i, r) * pull[i];
    }
    for (int r = 0; r < count; ++r) {
      right(r) /= length[r];
      for (int q = 0; q < count; ++q) A(r, q) /= length[r] * length[q];
    }
    const Vector nu = solveLu(A, right);
    for (int r = k; r < count; ++r) is_least = is_least && nu(r) >= -0.1 * kAside * size;
  });
  return is_least;
}

void LeastReactionSolver::select(unsigned corner) {
  const int k = static_cast<int>(drivetrain_.accelerationRows().size());
  row_count_ = 0;
  for (int m = 0; m < k && m < S; ++m) rows_[row_count_++] = rowOf(m);
  for (std::size_t j = 0; j < drivetrain_.kinks().size(); ++j) {
    if ((corner >> j & 1U) == 0U) continue;
    if (row_count_ < S) rows_[row_count_] = drivetrain_.kinks()[j];
    ++row_count_;
  }
}

bool LeastReactionSolver::calcStep(const StateView& state, const double* torque,
                                   const double* epsilon, const double* multipliers, Vector* step) {
  drivetrain_.countNewtonIteration();
  const int n = S + row_count_;
  //  [ J - sum lambda_m H_m   -C^T ] [d epsilon]     [ J epsilon + n - Q - C^T lambda ]
  //  [ C                       0   ] [d lambda ] = - [ psi                            ]
  Matrix K = Matrix::Zero(n, n);
  Vector right(n);
  double force[kMaxShafts] = {};  // J epsilon + n - Q - C^T lambda
  double unit[kMaxShafts];
  double column[kMaxShafts];
  for (int j = 0; j < S; ++j) {
    for (int i = 0; i < S; ++i) unit[i] = i == j ? 1.0 : 0.0;
    drivetrain_.inertia().multiply(unit, column);
    for (int i = 0; i < S; ++i) {
      K(i, j) = column[i];
      force[i] += column[i] * epsilon[j];
    }
  }
  for (int i = 0; i < S; ++i) force[i] -= torque[i];
  for (int m = 0; m < row_count_; ++m) {
    double C[kMaxShafts];
    double H[kMaxShafts * kMaxShafts];
    right(S + m) = -rows_[m]->calcResidualAndJacobian(state, C);
    rows_[m]->calcHessian(state, H);
    for (int i = 0; i < S; ++i) {
      K(S + m, i) = C[i];
      K(i, S + m) = -C[i];
      force[i] -= C[i] * multipliers[m];
      for (int j = 0; j < S; ++j) K(i, j) -= multipliers[m] * H[i * S + j];
    }
  }
  for (int i = 0; i < S; ++i) right(i) = -force[i];
  return solveScaled(K, right, 0, step);
}

bool LeastReactionSolver::isSmall(const Vector& step, const double* epsilon,
                                  double rounding) const {
  double scale = 0.0;
  for (int i = 0; i < S; ++i) scale = std::max(scale, std::abs(epsilon[i]));
  // Quadratic convergence: the step after one of 1e-9 is lost in rounding.
  return calcLength(step) <= std::max(1e-9 * scale, rounding);
}

}  // namespace variator_sim
