#include "dynamics/least_reaction_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

void LeastReactionSearch::add(const double* epsilon, const double* free) {
  free_ = free;
  record(epsilon, true);
}

LeastReactionSearch::Verdict LeastReactionSearch::find(const StateView& state, const double* torque,
                                                       const double* free) {
  state_ = state;
  torque_ = torque;
  free_ = free;
  evaluations_ = 0;
  ray_ = 0;
  random_ = 20;
  if (!setUp()) return conclude(false);
  if (candidate_count_ == 0) findFirst();
  if (candidate_count_ == 0) return Verdict::kNone;
  smallest_ = calcRoundingDistance();
  bool is_certain = true;
  int rays = kFewestRays;
  int quiet = 0;
  for (int round = 0; round < kMostRounds && quiet < (n_ == 1 ? 1 : 2); ++round) {
    const double before = candidates_[0].reaction;
    // The free accelerations themselves: nothing is less.
    if (!(radius() > smallest_)) return Verdict::kFound;
    const bool is_whole = n_ == 2 && is_cubic_ && lookThroughPlane();
    // The first look is a coarse one, which may make the ball much smaller.
    is_certain = is_whole || lookThrough(n_ == 1 ? 2 : rays, round == 0);
    descendAll();
    const bool is_better = candidates_[0].reaction < before * (1.0 - 1e-9);
    if (is_whole && !is_better) return conclude(true);
    quiet = is_better || round == 0 ? 0 : quiet + 1;
    if (n_ > 1 && round > 0) {
      // As many rays as there are minima to be told apart around the ball.
      const double wanted = kFewestRays * std::pow(std::max(1.0, minimaPerRay()), n_ - 1);
      if (wanted > rays && rays < kMostRays) quiet = 0;
      is_certain = is_certain && wanted <= kMostRays;
      rays = static_cast<int>(std::min<double>(std::max<double>(rays, wanted), kMostRays));
    }
  }
  return conclude(is_certain && quiet > 0);
}

bool LeastReactionSearch::setUp() {
  const unsigned nonlinear = drivetrain_.nonlinearAccelerations();
  n_ = 0;
  int which[kMaxShafts];
  for (int i = 0; i < S; ++i) {
    if ((nonlinear >> static_cast<unsigned>(i) & 1U) != 0U) which[n_++] = i;
  }
  is_cubic_ = true;
  for (int m = 0; m < rowCount(); ++m) {
    const int degree = row(m).accelerationDegree();
    is_cubic_ = is_cubic_ && degree >= 0 && degree <= 3;
  }
  Matrix inverse(S, S);
  for (int j = 0; j < S; ++j) {
    double unit[kMaxShafts] = {};
    double column[kMaxShafts];
    unit[j] = 1.0;
    drivetrain_.inertia().solve(unit, column);
    for (int i = 0; i < S; ++i) inverse(i, j) = column[i];
  }
  // How the others move with these held: no part of the rows that they multiply varies.
  const Matrix rest = makeBasis(which, inverse);
  const Matrix C = calcRowsOutside(inverse, rest);
  separateSoftRows(C, rest);
  return n_ > 0;
}

/// E: J^-1 times the unit vectors of the accelerations in `which`, orthonormal in the metric J
/// (Gram and Schmidt). Returns what is left of J^-1 without it.
LeastReactionSearch::Matrix LeastReactionSearch::makeBasis(const int* which,
                                                           const Matrix& inverse) {
  E_.resize(S, n_);
  for (int a = 0; a < n_; ++a) {
    double column[kMaxShafts];
    for (int i = 0; i < S; ++i) {
      column[i] = inverse(i, which[a]);
      for (int b = 0; b < a; ++b) column[i] -= E_(i, b) * E_(which[a], b);
    }
    const double length = std::sqrt(measure(column));
    for (int i = 0; i < S; ++i) E_(i, a) = column[i] / length;
  }
  Matrix rest = inverse;
  for (int i = 0; i < S; ++i) {
    for (int j = 0; j < S; ++j) {
      for (int a = 0; a < n_; ++a) rest(i, j) -= E_(i, a) * E_(j, a);
    }
  }
  for (int a = 0; a < n_; ++a) {
    rest.row(which[a]).setZero();
    rest.col(which[a]).setZero();
  }
  return rest;
}

/// The rows' coefficients outside of these accelerations, which are the same everywhere, made of
/// length 1; T has what makes them so.
LeastReactionSearch::Matrix LeastReactionSearch::calcRowsOutside(const Matrix& inverse,
                                                                 const Matrix& rest) {
  const int k = rowCount();
  StateView state = state_;
  Matrix C = Matrix::Zero(k, S);
  T_ = Matrix::Identity(k, k);
  for (int m = 0; m < k; ++m) {
    double epsilon[kMaxShafts];
    double values[kMaxShafts] = {};
    std::copy_n(free_, S, epsilon);
    state.acceleration = epsilon;
    for (int attempt = 0; attempt < 8; ++attempt) {
      row(m).calcResidualAndJacobian(state, values);
      double poison = 0.0;
      for (int i = 0; i < S; ++i) poison += 0.0 * values[i];
      if (poison == 0.0) break;
      for (int i = 0; i < S; ++i) epsilon[i] = free_[i] * nextUniform() + nextUniform();
    }
    double whole = 0.0;
    double outside = 0.0;
    for (int i = 0; i < S; ++i) {
      for (int j = 0; j < S; ++j) {
        whole += values[i] * inverse(i, j) * values[j];
        outside += values[i] * rest(i, j) * values[j];
      }
    }
    const bool has_outside = outside > 1e-20 * whole;
    const double length = std::sqrt(has_outside ? outside : whole);
    if (length > 0.0) T_(m, m) = 1.0 / length;
    for (int i = 0; i < S && has_outside; ++i) C(m, i) = values[i] / length;
  }
  return C;
}

/// T: combinations of the rows that are orthonormal outside, the longest ones first; what is left
/// of the others there is nothing, and they are hard.
void LeastReactionSearch::separateSoftRows(Matrix C, const Matrix& rest) {
  const int k = rowCount();
  F_ = Matrix::Zero(S, k);
  for (soft_ = 0; soft_ < k; ++soft_) {
    int longest = soft_;
    double most = 0.0;
    for (int m = soft_; m < k; ++m) {
      double square = 0.0;
      for (int i = 0; i < S; ++i) {
        for (int j = 0; j < S; ++j) square += C(m, i) * rest(i, j) * C(m, j);
      }
      if (!(square > most)) continue;
      most = square;
      longest = m;
    }
    if (!(most > 1e-10)) break;
    for (int i = 0; i < S; ++i) std::swap(C(soft_, i), C(longest, i));
    for (int m = 0; m < k; ++m) std::swap(T_(soft_, m), T_(longest, m));
    for (int i = 0; i < S; ++i) C(soft_, i) /= std::sqrt(most);
    for (int m = 0; m < k; ++m) T_(soft_, m) /= std::sqrt(most);
    for (int i = 0; i < S; ++i) {
      for (int j = 0; j < S; ++j) F_(i, soft_) += rest(i, j) * C(soft_, j);
    }
    for (int m = soft_ + 1; m < k; ++m) {
      double product = 0.0;
      for (int i = 0; i < S; ++i) product += C(m, i) * F_(i, soft_);
      for (int i = 0; i < S; ++i) C(m, i) -= product * C(soft_, i);
      for (int n = 0; n < k; ++n) T_(m, n) -= product * T_(soft_, n);
    }
  }
}

void LeastReactionSearch::descendAll() {
  for (int n = 0; n < start_count_; ++n) {
    // On one line the starts are the minima themselves.
    if (n_ == 1 && candidate_count_ > 0 && starts_[n].value > 3.0 * 2.0 * candidates_[0].reaction) {
      break;
    }
    descend(starts_[n].epsilon);
  }
}

double LeastReactionSearch::squaredDistance(const double* epsilon) const {
  double change[kMaxShafts];
  for (int i = 0; i < S; ++i) change[i] = epsilon[i] - free_[i];
  return measure(change);
}

double LeastReactionSearch::hopeful() const {
  return candidate_count_ > 0 ? 2.02 * candidates_[0].reaction
                              : std::numeric_limits<double>::infinity();
}

void LeastReactionSearch::descend(const double* start) {
  double epsilon[kMaxShafts];
  std::copy_n(start, S, epsilon);
  StateView state = state_;
  state.acceleration = epsilon;
  if (!solver_.retract(state, epsilon)) return;
  double value = squaredDistance(epsilon);
  bool is_stuck = false;  // on a kink, maybe
  for (int iteration = 0; iteration < 25; ++iteration) {
    double delta[kMaxShafts];
    double old[kMaxShafts];
    if (!drivetrain_.calcLinearizedReaction(state, free_, delta)) break;
    double length = 0.0;
    double size = 0.0;
    for (int i = 0; i < S; ++i) {
      old[i] = epsilon[i];
      delta[i] += free_[i] - epsilon[i];
      length = std::max(length, std::abs(delta[i]));
      size = std::max(size, std::abs(epsilon[i]));
    }
    if (!(length > 1e-6 * size)) break;
    // Far from the least and without much hope to get there.
    if (iteration >= 3 && value - 4.0 * measure(delta) > hopeful()) return;
    bool is_less = false;
    double fraction = 1.0;
    for (int halving = 0; halving < 10 && !is_less; ++halving, fraction *= 0.5) {
      for (int i = 0; i < S; ++i) epsilon[i] = old[i] + fraction * delta[i];
      if (!solver_.retract(state, epsilon)) continue;
      const double now = squaredDistance(epsilon);
      is_less = now < value * (1.0 - 1e-6 * fraction);
      if (is_less) value = now;
    }
    if (!is_less) {
      std::copy_n(old, S, epsilon);
      is_stuck = !drivetrain_.kinks().empty();
      break;
    }
  }
  if (value > hopeful() && !is_stuck) return;
  // The multipliers that leave the least of R.
  double multipliers[kMaxShafts] = {};
  double polished[kMaxShafts];
  std::copy_n(epsilon, S, polished);
  calcMultipliers(state, multipliers);
  bool is_polished = false;
  if (solver_.solve(state_, torque_, 0, polished, multipliers)) {
    record(polished, true);
    is_polished = squaredDistance(polished) <= value * (1.0 + 1e-9);
  }
  solver_.solveCorners(state_, torque_, epsilon, [&](const double* corner) {
    record(corner, true);
    is_polished = is_polished || squaredDistance(corner) <= value * (1.0 + 1e-9);
  });
  if (!is_polished) record(epsilon, false);
}

void LeastReactionSearch::calcMultipliers(const StateView& state, double* multipliers) const {
  const int k = rowCount();
  double C[kMaxRows][kMaxShafts];
  Matrix A(k, k);
  Vector right(k);
  for (int m = 0; m < k; ++m) row(m).calcResidualAndJacobian(state, C[m]);
  for (int m = 0; m < k; ++m) {
    double weighted[kMaxShafts];
    drivetrain_.inertia().solve(C[m], weighted);
    right(m) = 0.0;
    for (int i = 0; i < S; ++i) right(m) += C[m][i] * (state.acceleration[i] - free_[i]);
    for (int n = 0; n < k; ++n) {
      A(m, n) = 0.0;
      for (int i = 0; i < S; ++i) A(m, n) += C[n][i] * weighted[i];
    }
  }
  right = solveLu(A, right);
  if (!right.allFinite()) return;
  for (int m = 0; m < k && m < S; ++m) multipliers[m] = right(m);
}

void LeastReactionSearch::record(const double* epsilon, bool is_stationary) {
  Candidate candidate;
  candidate.is_stationary = is_stationary;
  std::copy_n(epsilon, S, candidate.epsilon);
  candidate.reaction = 0.5 * squaredDistance(epsilon);
  if (!std::isfinite(candidate.reaction)) return;
  double size = 0.0;
  for (int i = 0; i < S; ++i) {
    size = std::max({size, std::abs(epsilon[i]), std::abs(free_[i])});
  }
  for (int n = 0; n < candidate_count_; ++n) {
    double apart = 0.0;
    for (int i = 0; i < S; ++i) {
      apart = std::max(apart, std::abs(candidates_[n].epsilon[i] - epsilon[i]));
    }
    // The same one: the better digits.
    if (apart <= kSame * size) {
      const bool is_better = candidate.reaction < candidates_[n].reaction * (1.0 - 1e-12);
      if (candidates_[n].is_stationary && (!is_better || !is_stationary)) return;
      std::move(candidates_ + n + 1, candidates_ + candidate_count_, candidates_ + n);
      --candidate_count_;
      break;
    }
  }
  int place = candidate_count_;
  while (place > 0 && candidates_[place - 1].reaction > candidate.reaction) --place;
  if (place == kMostCandidates) return;
  candidate_count_ = std::min(candidate_count_ + 1, kMostCandidates);
  std::move_backward(candidates_ + place, candidates_ + candidate_count_ - 1,
                     candidates_ + candidate_count_);
  candidates_[place] = candidate;
}

void LeastReactionSearch::findFirst() {
  radius_ = 0.0;
  double size = 1e-3;
  for (int i = 0; i < S; ++i) size = std::max(size, std::abs(free_[i]));
  radius_ = 1e-2 * size * std::sqrt(drivetrain_.inertia().entry(0, 0));
  for (int growth = 0; growth < 24 && candidate_count_ == 0; ++growth, radius_ *= 4.0) {
    const bool is_whole = n_ == 2 && is_cubic_ && lookThroughPlane();
    if (!is_whole) lookThrough(n_ == 1 ? 2 : kFewestRays, true);
    descendAll();
  }
}

double LeastReactionSearch::calcRoundingDistance() const {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  const Inertia& inertia = drivetrain_.inertia();
  // f = J^-1 q is known to eps |J^-1| |q|, |q| = |J| |f|: much less well than to eps |f| where J is
  // nearly singular.
  double q[kMaxShafts];
  double rounding[kMaxShafts] = {};
  double size = 0.0;
  for (int i = 0; i < S; ++i) {
    size = std::max(size, std::abs(free_[i]));
    q[i] = 0.0;
    for (int j = 0; j < S; ++j) q[i] += std::abs(inertia.entry(i, j) * free_[j]);
  }
  for (int j = 0; j < S; ++j) {
    double unit[kMaxShafts] = {};
    double column[kMaxShafts];
    unit[j] = 1.0;
    inertia.solve(unit, column);
    for (int i = 0; i < S; ++i) rounding[i] += kEpsilon * std::abs(column[i]) * q[j];
  }
  double square = 0.0;
  for (int i = 0; i < S; ++i) {
    for (int j = 0; j < S; ++j) square += std::abs(inertia.entry(i, j)) * rounding[i] * rounding[j];
  }
  return std::max(64.0 * kEpsilon * size, std::sqrt(square));
}

LeastReactionSearch::Verdict LeastReactionSearch::conclude(bool is_certain) const {
  if (candidate_count_ == 0) return Verdict::kNone;
  if (candidate_count_ > 1) {
    const double least = candidates_[0].reaction;
    const double next = candidates_[1].reaction;
    const double rounding = smallest_ * std::sqrt(next);
    if (candidates_[0].is_stationary && candidates_[1].is_stationary &&
        next - least <= 1e-9 * next + rounding) {
      return Verdict::kTie;
    }
  }
  return is_certain && candidates_[0].is_stationary ? Verdict::kFound : Verdict::kDoubtful;
}

}  // namespace variator_sim
