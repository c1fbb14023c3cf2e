#include "dynamics/least_reaction_search.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "dynamics/quintic.h"

namespace variator_sim {

namespace {

/// T with T A T^T = diag(1, .., 1, 0, .., 0) of a symmetric semi-definite A; `rank` gets the number
/// of ones, one for each eigenvalue above `least`.
DenseMatrix orthonormalize(const DenseMatrix& A, double least, int* rank) {
  const Eigen::SelfAdjointEigenSolver<DenseMatrix> solver(A);
  const auto n = static_cast<int>(A.rows());
  DenseMatrix T = solver.eigenvectors().transpose().colwise().reverse();  // the largest first
  for (*rank = 0; *rank < n; ++*rank) {
    const double eigenvalue = solver.eigenvalues()(n - 1 - *rank);
    if (!(eigenvalue > least)) break;
    T.row(*rank) /= std::sqrt(eigenvalue);
  }
  return T;
}

}  // namespace

LeastReactionSearch::Verdict LeastReactionSearch::findLeastReaction(const StateView& state,
                                                                    double* epsilon) {
  constraints_.enter(state);
  const double* const f = free().data();
  std::copy_n(f, S, epsilon);
  if (!free().allFinite()) return Verdict::kNone;
  double multipliers[kMaxShafts] = {};
  bool is_found = solver_.solve(state, 0, epsilon, multipliers);
  if (!is_found) {
    // Far from psi = 0 Newton's iteration may lead away; damped steps to the solution of the
    // linearised constraints come near first.
    std::copy_n(f, S, epsilon);
    approach(state, epsilon);
    std::fill_n(multipliers, S, 0.0);
    is_found = solver_.solve(state, 0, epsilon, multipliers);
  }
  const Verdict verdict = find(state, is_found ? epsilon : nullptr);
  std::copy_n(candidate_count_ > 0 ? candidates_[0].epsilon : f, S, epsilon);
  return verdict;
}

bool LeastReactionSearch::retract(const StateView& state, double* epsilon) {
  constraints_.enter(state);
  StateView moving = state;
  moving.acceleration = epsilon;
  return solver_.retract(moving, epsilon);
}

void LeastReactionSearch::approach(const StateView& given, double* epsilon) {
  StateView state = given;
  state.acceleration = epsilon;
  for (int iteration = 0; iteration < 100; ++iteration) {
    double delta[kMaxShafts];
    if (!constraints_.calcCorrection(state, delta, true)) return;
    for (int i = 0; i < S; ++i) {
      if (!std::isfinite(delta[i])) return;
      epsilon[i] += 0.5 * (free()(i) + delta[i] - epsilon[i]);
    }
  }
}

LeastReactionSearch::Verdict LeastReactionSearch::find(const StateView& state,
                                                       const double* first) {
  state_ = state;
  candidate_count_ = 0;
  next_ray_ = 0;
  setUp();
  if (first != nullptr) record(Eigen::Map<const Vector>(first, S), true);
  const int rays = n_ == 1 ? 2 : kRays;
  parts_ = n_ == 1 ? 256 : 16;
  if (candidate_count_ == 0) findFirst(rays);
  if (candidate_count_ == 0) return Verdict::kNone;
  smallest_ = calcRoundingDistance();
  // In two dimensions a quarter of the rays, in a quarter of the parts, is enough where psi bends
  // little.
  bool is_certain = false;
  if (n_ == 2) {
    parts_ /= 4;
    is_certain = lookAround(rays / 4, rays);
    parts_ *= 4;
  }
  is_certain = is_certain || lookAround(rays, kMostRays);
  // The free accelerations themselves: nothing is less.
  if (!(calcRadius() > smallest_)) return Verdict::kFound;
  return conclude(is_certain);
}

bool LeastReactionSearch::lookAround(int fewest_rays, int most_rays) {
  constexpr int kMostRounds = 14;
  const bool is_quick = most_rays < kMostRays;
  bool is_certain = true;
  int rays = fewest_rays;
  int quiet = 0;
  for (int round = 0; round < kMostRounds && quiet < (n_ == 1 ? 1 : 2); ++round) {
    const double before = candidates_[0].reaction;
    if (!(calcRadius() > smallest_)) return true;
    // The first look is a coarse one, which may make the ball much smaller.
    is_certain = lookThrough(calcRadius(), rays, round == 0 ? 0 : kMostHalvings);
    const bool is_better = candidates_[0].reaction < before * (1.0 - 1e-9);
    quiet = is_better || round == 0 ? 0 : quiet + 1;
    if (n_ == 1 || round == 0) continue;
    // As many rays as there are minima to be told apart around the ball; of few ones more, as psi
    // needs samples along them: it bends around the ball, too.
    const double per_ray = std::max(1.0, static_cast<double>(noted_) / rays);
    const double samples = static_cast<double>(evaluations_) / rays / (2 * parts_ + 1);
    const double wanted =
        fewest_rays * (is_quick ? std::max(1.0, samples) : 1.0) * std::pow(per_ray, n_ - 1);
    if (is_quick && wanted > most_rays) return false;
    if (wanted > rays && rays < most_rays) quiet = 0;
    is_certain = is_certain && wanted <= most_rays;
    rays = static_cast<int>(std::clamp<double>(wanted, rays, most_rays));
  }
  return is_certain && quiet > 0;
}

void LeastReactionSearch::setUp() {
  const SquareMatrix& inverse = constraints_.mobility();
  n_ = 0;
  int which[kMaxShafts];
  for (int j = 0; j < S; ++j) {
    if (constraints_.nonlinear()[static_cast<std::size_t>(j)]) which[n_++] = j;
  }
  // E = J^-1 U T^T of the unit vectors U of these accelerations, with E^T J E = 1.
  Matrix columns(S, n_);
  Matrix gram(n_, n_);
  for (int a = 0; a < n_; ++a) {
    columns.col(a) = inverse.col(which[a]);
    for (int b = 0; b < n_; ++b) gram(a, b) = inverse(which[a], which[b]);
  }
  int rank;
  E_ = columns * orthonormalize(gram, 0.0, &rank).transpose();
  // How the others move with these held: no part of the rows that they multiply varies.
  Matrix rest = inverse - E_ * E_.transpose();
  for (int a = 0; a < n_; ++a) {
    rest.row(which[a]).setZero();
    rest.col(which[a]).setZero();
  }
  Vector length;
  const Matrix C = calcRowsOutside(rest, &length);
  const Matrix toC = rest * C.transpose();
  T_ = orthonormalize(C * toC, 1e-10, &soft_);
  F_ = toC * T_.topRows(soft_).transpose();
  T_ *= length.cwiseInverse().asDiagonal();
}

LeastReactionSearch::Matrix LeastReactionSearch::calcRowsOutside(const Matrix& rest,
                                                                 Vector* length) const {
  const int k = rowCount();
  Matrix C = Matrix::Zero(k, S);
  length->setOnes(k);
  StateView state = state_;
  Vector values(S);
  for (int m = 0; m < k; ++m) {
    double epsilon[kMaxShafts];
    std::copy_n(free().data(), S, epsilon);
    state.acceleration = epsilon;
    for (int attempt = 0; attempt < 8; ++attempt) {
      row(m).calcResidualAndJacobian(state, values.data());
      if (values.allFinite()) break;
      for (int i = 0; i < S; ++i) epsilon[i] = 0.6 * free()(i) + 0.3 * attempt + 0.1 * i;
    }
    const double whole = values.dot(constraints_.mobility() * values);
    const double outside = values.dot(rest * values);
    const bool has_outside = outside > 1e-20 * whole;
    const double size = std::sqrt(has_outside ? outside : whole);
    if (size > 0.0) (*length)(m) = size;
    if (has_outside) C.row(m) = values.transpose() / size;
  }
  return C;
}

LeastReactionSearch::Vector LeastReactionSearch::calcDirection(int ray) const {
  double values[kMaxShafts] = {};
  Eigen::Map<Vector> direction(values, n_);
  if (n_ == 1) {
    direction(0) = ray % 2 == 0 ? 1.0 : -1.0;
  } else if (n_ == 2) {
    const double angle = 2.399963229728653 * ray;  // the golden angle: never twice alike
    direction(0) = std::cos(angle);
    direction(1) = std::sin(angle);
  } else {
    // Normal deviates prefer no direction.
    std::minstd_rand random(static_cast<unsigned>(ray) + 1U);
    std::normal_distribution<double> normal;
    for (int a = 0; a < n_; ++a) direction(a) = normal(random);
    direction.normalize();
  }
  return E_ * direction;
}

LeastReactionSearch::Sample LeastReactionSearch::evaluate(const Vector& along, double t) {
  ++evaluations_;
  const Vector aimed = free() + t * along;
  StateView state = state_;
  state.acceleration = aimed.data();
  Vector psi(rowCount());
  Vector rate(rowCount());
  Vector C(S);
  for (int m = 0; m < rowCount(); ++m) {
    psi(m) = row(m).calcResidualAndJacobian(state, C.data());
    rate(m) = C.dot(along);
  }
  return {t, T_ * psi, T_ * rate};
}

LeastReactionSearch::Sample LeastReactionSearch::interpolate(const Sample& a, const Sample& b,
                                                             double theta) {
  const double h = b.t - a.t;
  const double rest = 1.0 - theta;
  const Vector change = b.v - a.v;
  const Vector left = h * a.dv - change;
  const Vector right = change - h * b.dv;
  return {a.t + theta * h, a.v + theta * (change + rest * (rest * left + theta * right)),
          (change + (rest * rest - 2.0 * theta * rest) * left +
           (2.0 * theta * rest - theta * theta) * right) /
              h};
}

bool LeastReactionSearch::lookThrough(double radius, int rays, int halvings) {
  // Starts of minima just inside may lie just outside.
  constexpr double kBeyond = 1.2;
  start_count_ = 0;
  noted_ = 0;
  evaluations_ = 0;
  is_resolved_ = true;
  reach_ = kBeyond * radius;
  apart_ = (n_ == 1 ? 1e-6 : 0.03) * radius;
  negligible_ = 1e-9 * radius;
  for (int ray = 0; ray < rays; ++ray) {
    const Vector along = calcDirection(next_ray_++);
    Sample from = evaluate(along, 0.0);
    if (ray == 0) noteStart(from, along, 1.0);
    for (int part = 1; part <= parts_; ++part) {
      // Uneven parts: a periodic psi may not have their period.
      const double end = part < parts_ ? part + 0.2 * std::sin(part * part) : part;
      const Sample to = evaluate(along, reach_ * end / parts_);
      lookWithin(from, to, along, halvings);
      from = to;
    }
  }
  for (int n = 0; n < start_count_; ++n) {
    // On one line the starts are the minima themselves.
    if (n_ == 1 && starts_[n].value > 3.0 * hopeful()) break;
    descend(starts_[n].epsilon);
  }
  return is_resolved_;
}

void LeastReactionSearch::lookWithin(const Sample& from, const Sample& to, const Vector& along,
                                     int halvings) {
  const Sample middle = evaluate(along, 0.5 * (from.t + to.t));
  const int finite = int{from.isFinite()} + int{middle.isFinite()} + int{to.isFinite()};
  if (finite == 0) return;
  const Fit fit = finite < 3 ? Fit::kOther : judge(from, middle, to);
  if (fit == Fit::kFar) return;
  if (fit == Fit::kOther && halvings > 0) {
    if (evaluations_ <= kMostEvaluations) {
      lookWithin(from, middle, along, halvings - 1);
      lookWithin(middle, to, along, halvings - 1);
      return;
    }
    is_resolved_ = false;
  }
  if (finite < 3) {
    noteStart(from.isFinite() ? from : to, along, 4.0);  // the end of psi's domain
    return;
  }
  noteStarts(from, middle, along);
  noteStarts(middle, to, along);
}

LeastReactionSearch::Fit LeastReactionSearch::judge(const Sample& from, const Sample& middle,
                                                    const Sample& to) const {
  const Sample expected = interpolate(from, to, 0.5);
  const double h = to.t - from.t;
  Fit fit = Fit::kCubic;
  double least = from.t * from.t;  // of |epsilon - f|^2, by all that is known of v
  for (int r = 0; r < rowCount(); ++r) {
    const auto [lowest, highest] = std::minmax({from.v(r), middle.v(r), to.v(r)});
    const double steepest =
        std::max({std::abs(from.dv(r)), std::abs(middle.dv(r)), std::abs(to.dv(r))});
    const double error = std::abs(middle.v(r) - expected.v(r));
    if (error > 0.02 * (highest - lowest) + negligible_ ||
        std::abs(middle.dv(r) - expected.dv(r)) > 0.2 * steepest + negligible_ / h) {
      fit = Fit::kOther;
    }
    // So far may v swing beyond the three samples.
    const double swing =
        4.0 * error +
        0.125 * h * (std::abs(from.dv(r) - middle.dv(r)) + std::abs(to.dv(r) - middle.dv(r)));
    const double nearest = std::max({0.0, lowest - swing, -highest - swing});
    if (r < soft_) {
      least += nearest * nearest;
    } else if (nearest > 0.0 && n_ == 1) {
      return Fit::kFar;  // not zero here
    }
  }
  return least > reach_ * reach_ ? Fit::kFar : fit;
}

void LeastReactionSearch::noteStarts(const Sample& from, const Sample& to, const Vector& along) {
  // In theta = 0 .. 1 of the length h: v of degree 3 and its derivative of degree 2,
  //     v = sum_i B^3_i a_i,   a = v_0, v_0 + h v_0'/3, v_1 - h v_1'/3, v_1,
  //     v' = sum_j B^2_j 3 (a_j+1 - a_j),
  // and the slope of 1/2 |epsilon - f|^2 (or of 1/2 |hard|^2) of degree 5:
  //     h t + sum_r v v',   B^3_i B^2_j = C(3, i) C(2, j) / C(5, i + j) B^5_i+j.
  constexpr double kOfThree[] = {1.0, 3.0, 3.0, 1.0};
  constexpr double kOfTwo[] = {1.0, 2.0, 1.0};
  constexpr double kOfFive[] = {1.0, 5.0, 10.0, 10.0, 5.0, 1.0};
  const int hard = rowCount() - soft_;
  const double h = to.t - from.t;
  Quintic slope{};
  Quintic value{};  // of the last row
  for (int r = hard > 0 ? soft_ : 0; r < rowCount(); ++r) {
    const double a[] = {from.v(r), from.v(r) + h * from.dv(r) / 3.0, to.v(r) - h * to.dv(r) / 3.0,
                        to.v(r)};
    value = {};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const double share = kOfThree[i] * kOfTwo[j] / kOfFive[i + j];
        slope[i + j] += share * a[i] * 3.0 * (a[j + 1] - a[j]);
        value[i + j] += share * a[i];
      }
    }
  }
  for (std::size_t n = 0; n < 6 && hard == 0; ++n) {
    slope[n] += h * (from.t + 0.2 * static_cast<double>(n) * h);
  }
  findZeros(slope, 0.0, 1.0, true, [&](double theta) {
    noteStart(interpolate(from, to, theta), along, hard > 0 ? 4.0 : 1.0);
  });
  if (hard != 1) return;
  findZeros(value, 0.0, 1.0, false,
            [&](double theta) { noteStart(interpolate(from, to, theta), along, 1.0); });
}

template <class Item, class Compare>
void LeastReactionSearch::keep(const Item& item, double Item::*value, int most, Item* items,
                               int* count, Compare compare) {
  for (int n = 0; n < *count; ++n) {
    const Twin twin = compare(items[n]);
    if (twin == Twin::kNone) continue;
    if (twin == Twin::kBetter) return;
    std::move(items + n + 1, items + *count, items + n);
    --*count;
    break;
  }
  int place = *count;
  while (place > 0 && items[place - 1].*value > item.*value) --place;
  if (place == most) return;
  *count = std::min(*count + 1, most);
  std::move_backward(items + place, items + *count - 1, items + *count);
  items[place] = item;
}

void LeastReactionSearch::noteStart(const Sample& sample, const Vector& along, double penalty) {
  if (!sample.isFinite()) return;
  const Vector v = sample.v.head(soft_);
  const Start start{free() + sample.t * along - F_ * v,
                    (sample.t * sample.t + v.squaredNorm()) * penalty};
  if (penalty == 1.0) ++noted_;
  keep(start, &Start::value, kMostStarts, starts_, &start_count_, [&](const Start& other) {
    if (measure(other.epsilon - start.epsilon) > apart_ * apart_) return Twin::kNone;
    return start.value < other.value ? Twin::kWorse : Twin::kBetter;
  });
}

double LeastReactionSearch::measure(const Vector& v) const {
  return v.dot(constraints_.inertia() * v);
}

double LeastReactionSearch::squaredDistance(const Vector& epsilon) const {
  return measure(epsilon - free());
}

double LeastReactionSearch::hopeful() const {
  return candidate_count_ > 0 ? 2.02 * candidates_[0].reaction
                              : std::numeric_limits<double>::infinity();
}

void LeastReactionSearch::descend(Vector epsilon) {
  StateView state = state_;
  state.acceleration = epsilon.data();
  if (!solver_.retract(state, epsilon.data())) return;
  double value = squaredDistance(epsilon);
  bool is_stuck = false;  // on a kink, maybe
  for (int iteration = 0; iteration < 25; ++iteration) {
    Vector delta(S);
    if (!constraints_.calcCorrection(state, delta.data(), true)) break;
    const Vector old = epsilon;
    delta += free() - epsilon;
    if (!(delta.cwiseAbs().maxCoeff() > 1e-6 * epsilon.cwiseAbs().maxCoeff())) break;
    // Far from the least and without much hope to get there.
    if (iteration >= 3 && value - 4.0 * measure(delta) > hopeful()) return;
    bool is_less = false;
    double fraction = 1.0;
    for (int halving = 0; halving < 10 && !is_less; ++halving, fraction *= 0.5) {
      epsilon = old + fraction * delta;
      if (!solver_.retract(state, epsilon.data())) continue;
      const double now = squaredDistance(epsilon);
      is_less = now < value * (1.0 - 1e-6 * fraction);
      if (is_less) value = now;
    }
    if (!is_less) {
      epsilon = old;
      is_stuck = !constraints_.kinks().empty();
      break;
    }
  }
  if (value <= hopeful() || is_stuck) polish(state, epsilon, value);
}

void LeastReactionSearch::polish(const StateView& state, const Vector& epsilon, double value) {
  double multipliers[kMaxShafts] = {};
  Vector polished = epsilon;
  if (!constraints_.calcMultipliers(state, multipliers)) std::fill_n(multipliers, S, 0.0);
  bool is_polished = false;
  const auto take = [&](const Vector& point) {
    record(point, true);
    is_polished = is_polished || squaredDistance(point) <= value * (1.0 + 1e-9);
  };
  if (solver_.solve(state_, 0, polished.data(), multipliers)) take(polished);
  solver_.solveCorners(state_, epsilon.data(),
                       [&](const double* corner) { take(Eigen::Map<const Vector>(corner, S)); });
  if (!is_polished) record(epsilon, false);
}

void LeastReactionSearch::record(const Vector& epsilon, bool is_stationary) {
  Candidate candidate{{}, 0.5 * squaredDistance(epsilon), is_stationary};
  if (!std::isfinite(candidate.reaction)) return;
  std::copy_n(epsilon.data(), S, candidate.epsilon);
  const double size = std::max(epsilon.cwiseAbs().maxCoeff(), free().cwiseAbs().maxCoeff());
  keep(candidate, &Candidate::reaction, kMostCandidates, candidates_, &candidate_count_,
       [&](const Candidate& other) {
         const Vector apart = Eigen::Map<const Vector>(other.epsilon, S) - epsilon;
         if (!(apart.cwiseAbs().maxCoeff() <= kSame * size)) return Twin::kNone;
         // The same one: the better digits.
         const bool is_better = candidate.reaction < other.reaction * (1.0 - 1e-12);
         return !other.is_stationary || (is_better && is_stationary) ? Twin::kWorse : Twin::kBetter;
       });
}

void LeastReactionSearch::findFirst(int rays) {
  double radius = 1e-3;
  for (int i = 0; i < S; ++i) radius = std::max(radius, std::abs(free()(i)));
  radius *= 1e-2 * std::sqrt(constraints_.inertia()(0, 0));
  for (int growth = 0; growth < 24 && candidate_count_ == 0; ++growth, radius *= 4.0) {
    lookThrough(radius, rays, 0);
  }
}

double LeastReactionSearch::calcRoundingDistance() const {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  // f = J^-1 q is known to eps |J^-1| |q|, |q| = |J| |f|: much less well than to eps |f| where J is
  // nearly singular.
  const Vector f = free().cwiseAbs();
  const Matrix J = constraints_.inertia().cwiseAbs();
  const Vector rounding = kEpsilon * (constraints_.mobility().cwiseAbs() * (J * f));
  return std::max(64.0 * kEpsilon * f.maxCoeff(), std::sqrt(rounding.dot(J * rounding)));
}

LeastReactionSearch::Verdict LeastReactionSearch::conclude(bool is_certain) const {
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
