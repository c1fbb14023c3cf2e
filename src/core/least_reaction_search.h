/// The least of all least reactions: the point of psi = 0 nearest to the free accelerations.
///
/// Where psi is nonlinear in epsilon the distance may have many minima on psi = 0. One found at a
/// distance r bounds the search to the ball of radius r (in the metric J) around the free
/// accelerations f. psi reads only some accelerations other than linearly, n of them: with
///     epsilon = f + E x - F v(x),   |epsilon - f|^2 = |x|^2 + |v(x)|^2,
/// x (n values) moves these and the rest goes along as J has it; v makes zero what of psi = 0 the
/// others can make zero, at the least distance and by constant coefficients. What they cannot, the
/// `hard` rest, is to be zero by x alone. So the ball is one of n dimensions, n = 1 in most scenes.
/// It is looked through along rays, by steps as short as psi asks for there; the least ones found
/// are starts for descents along psi = 0. A better minimum makes the ball smaller, and it is looked
/// through again until nothing better comes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "drivetrain.h"
#include "least_reaction.h"

namespace variator_sim {

/// Not for the running loop, but free of allocation all the same: a command at the first instant
/// calls it anew.
class LeastReactionSearch {
 public:
  /// Accelerations with psi = 0 and the reaction 1/2 R^T J^-1 R there.
  struct Candidate {
    double epsilon[kMaxShafts];
    double reaction;
    bool is_stationary;
  };
  enum class Verdict {
    kFound,     ///< the first candidate is the least
    kTie,       ///< the first two are equally good
    kDoubtful,  ///< there may be a better one than the first
    kNone
  };

  LeastReactionSearch(Drivetrain& drivetrain, LeastReactionSolver& solver)
      : S(drivetrain.shafts()), drivetrain_(drivetrain), solver_(solver) {}

  /// The best ones, the least reaction first.
  int candidateCount() const { return candidate_count_; }
  const Candidate& candidate(int n) const { return candidates_[n]; }
  void forget() { candidate_count_ = 0; }
  /// Adds accelerations that satisfy psi = 0.
  void add(const double* epsilon, const double* free) {
    free_ = free;
    record(epsilon, true);
  }

  /// Looks for better ones than those added. `torque` is Q - n, `free` J^-1 (Q - n).
  Verdict find(const StateView& state, const double* torque, const double* free) {
    state_ = state;
    torque_ = torque;
    free_ = free;
    evaluations_ = 0;
    ray_ = 0;
    random_ = 20;
    if (!setUp()) return conclude(false);
    if (candidate_count_ == 0) findFirst();
    if (candidate_count_ == 0) return Verdict::kNone;
    // What is left of the free accelerations by rounding is no distance.
    double size = 0.0;
    for (int i = 0; i < S; ++i) size = std::max(size, std::abs(free[i]));
    smallest_ = 64.0 * std::numeric_limits<double>::epsilon() * size;
    bool is_certain = true;
    int rays = kFewestRays;
    int quiet = 0;
    for (int round = 0; round < kMostRounds && quiet < (n_ == 1 ? 1 : 2); ++round) {
      const double before = candidates_[0].reaction;
      if (!(radius() > smallest_)) return conclude(true);
      // The first look is a coarse one, which may make the ball much smaller.
      is_certain = lookThrough(n_ == 1 ? 2 : rays, round == 0);
      descendAll();
      const bool is_better = candidates_[0].reaction < before * (1.0 - 1e-9);
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

 private:
  static constexpr int kFewestRays = 96;
  static constexpr int kMostRays = 768;
  static constexpr int kMostRounds = 14;
  static constexpr int kMostStarts = 48;
  static constexpr int kMostCandidates = 4;
  static constexpr int kDeepest = 22;
  /// Evaluations of psi that one look through the ball may take.
  static constexpr int kMostEvaluations = 40000;

  using Matrix = DenseMatrix;
  using Vector = DenseVector;

  /// psi on a ray: the soft part v, then the hard one, and their derivatives by t.
  struct Point {
    double t = 0.0;
    double v[kMaxRows] = {};
    double dv[kMaxRows] = {};
    bool is_finite = false;
  };
  struct Start {
    double epsilon[kMaxShafts];
    double value;
  };

  int rowCount() const { return static_cast<int>(drivetrain_.accelerationRows().size()); }
  const Constraint& row(int m) const {
    return drivetrain_.constraint(drivetrain_.accelerationRows()[static_cast<std::size_t>(m)]);
  }
  double radius() const {
    return candidate_count_ > 0 ? std::sqrt(2.0 * candidates_[0].reaction) : radius_;
  }

  // --- E, F, and what makes v of psi -----------------------------------------------------------
  bool setUp() {
    const unsigned nonlinear = drivetrain_.nonlinearAccelerations();
    n_ = 0;
    int which[kMaxShafts];
    for (int i = 0; i < S; ++i) {
      if ((nonlinear >> static_cast<unsigned>(i) & 1U) != 0U) which[n_++] = i;
    }
    // E: J^-1 times their unit vectors, orthonormal in the metric J (Gram and Schmidt).
    Matrix inverse(S, S);
    E_.resize(S, n_);
    for (int j = 0; j < S; ++j) {
      double unit[kMaxShafts] = {};
      double column[kMaxShafts];
      unit[j] = 1.0;
      drivetrain_.inertia().solve(unit, column);
      for (int i = 0; i < S; ++i) inverse(i, j) = column[i];
    }
    for (int a = 0; a < n_; ++a) {
      double column[kMaxShafts];
      for (int i = 0; i < S; ++i) {
        column[i] = inverse(i, which[a]);
        for (int b = 0; b < a; ++b) column[i] -= E_(i, b) * E_(which[a], b);
      }
      const double length = std::sqrt(measure(column));
      for (int i = 0; i < S; ++i) E_(i, a) = column[i] / length;
    }
    // The rest of J^-1: how the others move with these held.
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
    // The rows' coefficients outside of these accelerations are the same everywhere.
    const int k = rowCount();
    StateView state = state_;
    Matrix C = Matrix::Zero(k, S);  // there
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
    // T: combinations of the rows that are orthonormal there, the longest ones first; what is left
    // of the others is nothing, and they are hard.
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
    return n_ > 0;
  }

  // --- along rays ------------------------------------------------------------------------------
  /// The direction of the next ray, of length 1.
  void nextDirection() {
    double direction[kMaxShafts] = {};
    ++ray_;
    if (n_ == 1) {
      direction[0] = ray_ % 2 == 1 ? 1.0 : -1.0;
    } else if (n_ == 2) {
      const double angle = 2.399963229728653 * ray_;  // the golden angle: never twice alike
      direction[0] = std::cos(angle);
      direction[1] = std::sin(angle);
    } else {
      for (int a = 0; a < n_; ++a) direction[a] = nextNormal();
    }
    double length = 0.0;
    for (int a = 0; a < n_; ++a) length += direction[a] * direction[a];
    length = std::sqrt(length);
    for (int i = 0; i < S; ++i) {
      along_[i] = 0.0;
      for (int a = 0; a < n_; ++a) along_[i] += E_(i, a) * direction[a] / length;
    }
  }
  /// Pseudo-random numbers, the same ones in every search.
  double nextUniform() {
    random_ = random_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return (static_cast<double>(random_ >> 11) + 0.5) / 9007199254740992.0;
  }
  double nextNormal() {
    const double radius = std::sqrt(-2.0 * std::log(nextUniform()));
    return radius * std::cos(2.0 * 3.141592653589793 * nextUniform());
  }

  void evaluate(double t, Point* point) {
    ++evaluations_;
    const int k = rowCount();
    double epsilon[kMaxShafts];
    for (int i = 0; i < S; ++i) epsilon[i] = free_[i] + t * along_[i];
    StateView state = state_;
    state.acceleration = epsilon;
    double psi[kMaxRows] = {};
    double rate[kMaxRows] = {};
    for (int m = 0; m < k; ++m) {
      double C[kMaxShafts];
      psi[m] = row(m).calcResidualAndJacobian(state, C);
      for (int i = 0; i < S; ++i) rate[m] += C[i] * along_[i];
    }
    point->t = t;
    double poison = 0.0;  // 0 * finite = 0, 0 * (inf or NaN) = NaN
    for (int r = 0; r < k; ++r) {
      point->v[r] = point->dv[r] = 0.0;
      for (int m = 0; m < k; ++m) {
        point->v[r] += T_(r, m) * psi[m];
        point->dv[r] += T_(r, m) * rate[m];
      }
      poison += 0.0 * (point->v[r] + point->dv[r]);
    }
    point->is_finite = poison == 0.0;
  }
  /// Squared distance |epsilon - f|^2 of what the ray's point makes, and its derivative by t.
  double distance(const Point& p, double* slope) const {
    double sum = p.t * p.t;
    *slope = 2.0 * p.t;
    for (int r = 0; r < soft_; ++r) {
      sum += p.v[r] * p.v[r];
      *slope += 2.0 * p.v[r] * p.dv[r];
    }
    return sum;
  }
  double hardSquare(const Point& p, double* slope) const {
    double sum = 0.0;
    *slope = 0.0;
    for (int r = soft_; r < rowCount(); ++r) {
      sum += p.v[r] * p.v[r];
      *slope += 2.0 * p.v[r] * p.dv[r];
    }
    return sum;
  }

  /// Notes the starts in the ball, along so many rays. False when psi varies too fast for it.
  bool lookThrough(int rays, bool is_coarse) {
    start_count_ = 0;
    noted_ = 0;
    looked_rays_ = rays;
    is_coarse_ = is_coarse;
    const double reach = radius();
    allowed_ = reach * reach;
    negligible_ = 1e-9 * reach;  // by so little a distance is as good as another
    const int parts = n_ == 1 ? (is_coarse ? 64 : 256) : (is_coarse ? 8 : 16);
    const int limit = evaluations_ + kMostEvaluations;
    limit_ = limit;
    is_resolved_ = true;
    for (int ray = 0; ray < rays; ++ray) {
      nextDirection();
      Point from;
      evaluate(0.0, &from);
      if (ray == 0) noteStart(from, 0.0);
      for (int part = 1; part <= parts; ++part) {
        // Uneven parts: what swings may not swing along with them.
        const double jitter = part < parts ? 0.4 * (nextUniform() - 0.5) : 0.0;
        Point to;
        evaluate(reach * (part + jitter) / parts, &to);
        scan(from, to, 0);
        from = to;
      }
    }
    return is_resolved_;
  }

  /// Cubic through both ends at the part `theta` of [a, b].
  void interpolate(const Point& a, const Point& b, double theta, Point* p) const {
    const double h = b.t - a.t;
    const double rest = 1.0 - theta;
    p->t = a.t + theta * h;
    p->is_finite = true;
    for (int r = 0; r < rowCount(); ++r) {
      const double change = b.v[r] - a.v[r];
      const double left = h * a.dv[r] - change;
      const double right = change - h * b.dv[r];
      p->v[r] = a.v[r] + theta * (change + rest * (rest * left + theta * right));
      p->dv[r] = (change + (rest * rest - 2.0 * theta * rest) * left +
                  (2.0 * theta * rest - theta * theta) * right) /
                 h;
    }
  }

  void scan(const Point& a, const Point& b, int depth) {
    if (a.t * a.t > allowed_) return;
    Point middle;
    evaluate(0.5 * (a.t + b.t), &middle);
    const bool is_end = depth >= (is_coarse_ ? 0 : kDeepest);
    if (!a.is_finite || !b.is_finite || !middle.is_finite) {
      if (is_end) return;
      if (evaluations_ > limit_) {
        is_resolved_ = false;
        return;
      }
      // The domain's end may lie within.
      if (a.is_finite || b.is_finite || middle.is_finite) {
        scan(a, middle, depth + 1);
        scan(middle, b, depth + 1);
      }
      return;
    }
    Point expected;
    interpolate(a, b, 0.5, &expected);
    const double h = b.t - a.t;
    double least = a.t * a.t;  // distance, at least, by what is known of v
    bool is_good = true;
    for (int r = 0; r < rowCount(); ++r) {
      const double error = std::abs(middle.v[r] - expected.v[r]);
      const double highest = std::max({a.v[r], b.v[r], middle.v[r]});
      const double lowest = std::min({a.v[r], b.v[r], middle.v[r]});
      const double steepest =
          std::max({std::abs(a.dv[r]), std::abs(b.dv[r]), std::abs(middle.dv[r])});
      is_good = is_good && error <= 0.02 * (highest - lowest) + negligible_ &&
                std::abs(middle.dv[r] - expected.dv[r]) <= 0.2 * steepest + negligible_ / h;
      // How far v may swing beyond the three points.
      const double swing =
          4.0 * error +
          0.125 * h * (std::abs(a.dv[r] - middle.dv[r]) + std::abs(b.dv[r] - middle.dv[r]));
      const double nearest = lowest > 0.0 ? lowest : (highest < 0.0 ? -highest : 0.0);
      const double left = std::max(0.0, nearest - swing);
      if (r < soft_) {
        least += left * left;
      } else if (left > 0.0 && n_ == 1) {
        return;  // not zero here
      }
    }
    if (least > allowed_) return;
    if (!is_good && !is_end) {
      if (evaluations_ > limit_) {
        is_resolved_ = false;
      } else {
        scan(a, middle, depth + 1);
        scan(middle, b, depth + 1);
        return;
      }
    }
    noteWithin(a, middle);
    noteWithin(middle, b);
  }

  /// Notes minima of the distance (or, with a hard part, where that is zero or least) in [a, b].
  void noteWithin(const Point& a, const Point& b) {
    constexpr int kParts = 4;
    const int hard = rowCount() - soft_;
    Point left = a;
    for (int part = 1; part <= kParts; ++part) {
      Point right = b;
      if (part < kParts) interpolate(a, b, static_cast<double>(part) / kParts, &right);
      double slope_left;
      double slope_right;
      Point found;
      if (hard == 0) {
        distance(left, &slope_left);
        distance(right, &slope_right);
      } else {
        hardSquare(left, &slope_left);
        hardSquare(right, &slope_right);
      }
      double theta = -1.0;
      double penalty = 1.0;
      if (hard == 1 && (left.v[soft_] < 0.0) != (right.v[soft_] < 0.0)) {
        theta = left.v[soft_] / (left.v[soft_] - right.v[soft_]);
      } else if (slope_left < 0.0 && slope_right >= 0.0) {
        theta = slope_left / (slope_left - slope_right);
        if (hard > 0) penalty = 4.0;
      }
      if (theta >= 0.0) {
        interpolate(left, right, theta, &found);
        noteStart(found, penalty);
      }
      left = right;
    }
  }

  /// Keeps the point a ray leads to among the kMostStarts nearest ones, one of each place.
  void noteStart(const Point& point, double penalty) {
    if (!point.is_finite) return;
    double slope;
    Start start;
    start.value = distance(point, &slope) * penalty;
    for (int i = 0; i < S; ++i) start.epsilon[i] = free_[i] + point.t * along_[i];
    for (int r = 0; r < soft_; ++r) {
      for (int i = 0; i < S; ++i) start.epsilon[i] -= F_(i, r) * point.v[r];
    }
    if (penalty == 1.0) ++noted_;
    const double apart = (n_ == 1 ? 1e-6 : 0.03) * radius();
    for (int n = 0; n < start_count_; ++n) {
      if (!areNear(starts_[n].epsilon, start.epsilon, apart)) continue;
      if (start.value >= starts_[n].value) return;
      std::move(starts_ + n + 1, starts_ + start_count_, starts_ + n);
      --start_count_;
      break;
    }
    int place = start_count_;
    while (place > 0 && starts_[place - 1].value > start.value) --place;
    if (place == kMostStarts) return;
    start_count_ = std::min(start_count_ + 1, kMostStarts);
    std::move_backward(starts_ + place, starts_ + start_count_ - 1, starts_ + start_count_);
    starts_[place] = start;
  }
  double minimaPerRay() const { return static_cast<double>(noted_) / looked_rays_; }

  /// Within `apart` of each other in the metric J.
  bool areNear(const double* a, const double* b, double apart) const {
    double change[kMaxShafts];
    for (int i = 0; i < S; ++i) change[i] = a[i] - b[i];
    return measure(change) <= apart * apart;
  }
  /// |v|^2 in the metric J.
  double measure(const double* v) const {
    double force[kMaxShafts];
    drivetrain_.inertia().multiply(v, force);
    double sum = 0.0;
    for (int i = 0; i < S; ++i) sum += v[i] * force[i];
    return sum;
  }

  // --- descents --------------------------------------------------------------------------------
  void descendAll() {
    for (int n = 0; n < start_count_; ++n) {
      // On one line the starts are the minima themselves.
      if (n_ == 1 && candidate_count_ > 0 &&
          starts_[n].value > 3.0 * 2.0 * candidates_[0].reaction) {
        break;
      }
      descend(starts_[n].epsilon);
    }
  }

  double squaredDistance(const double* epsilon) const {
    double change[kMaxShafts];
    for (int i = 0; i < S; ++i) change[i] = epsilon[i] - free_[i];
    return measure(change);
  }

  /// Squared distances above this are of no interest.
  double hopeful() const {
    return candidate_count_ > 0 ? 2.02 * candidates_[0].reaction
                                : std::numeric_limits<double>::infinity();
  }

  /// Along psi = 0 towards the least reaction of the linearised constraints, by steps that lessen
  /// the reaction; then Newton's iteration, and the corners near by.
  void descend(const double* start) {
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

  /// lambda with C^T lambda nearest to R = J (epsilon - f): A lambda = C (epsilon - f).
  void calcMultipliers(const StateView& state, double* multipliers) const {
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

  /// Puts accelerations with psi = 0 among the candidates.
  void record(const double* epsilon, bool is_stationary) {
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

  /// Without a candidate nothing bounds the ball: it grows until there is one.
  void findFirst() {
    radius_ = 0.0;
    double size = 1e-3;
    for (int i = 0; i < S; ++i) size = std::max(size, std::abs(free_[i]));
    radius_ = 1e-2 * size * std::sqrt(drivetrain_.inertia().entry(0, 0));
    for (int growth = 0; growth < 24 && candidate_count_ == 0; ++growth, radius_ *= 4.0) {
      lookThrough(n_ == 1 ? 2 : kFewestRays, true);
      descendAll();
    }
  }

  Verdict conclude(bool is_certain) const {
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

  /// Points that are nearer to each other than this, relative to accelerations, are one.
  static constexpr double kSame = 1e-6;

  const int S;  // shafts
  Drivetrain& drivetrain_;
  LeastReactionSolver& solver_;
  StateView state_{};
  const double* torque_ = nullptr;
  const double* free_ = nullptr;
  int n_ = 0;                      // accelerations that psi is not linear in
  int soft_ = 0;                   // rows that the others can make zero
  Matrix E_;                       // S x n
  Matrix F_;                       // S x k
  Matrix T_;                       // (v, hard) = T psi
  double along_[kMaxShafts] = {};  // the ray in epsilon
  std::uint64_t random_ = 20;
  int ray_ = 0;
  int looked_rays_ = 1;
  int noted_ = 0;
  int evaluations_ = 0;
  int limit_ = 0;
  bool is_coarse_ = false;
  bool is_resolved_ = true;
  double allowed_ = 0.0;
  double negligible_ = 0.0;
  double radius_ = 0.0;
  double smallest_ = 0.0;
  Start starts_[kMostStarts];
  int start_count_ = 0;
  Candidate candidates_[kMostCandidates];
  int candidate_count_ = 0;
};

}  // namespace variator_sim
