#include <algorithm>
#include <cmath>

#include "dynamics/least_reaction_search.h"

namespace variator_sim {

void LeastReactionSearch::nextDirection() {
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

double LeastReactionSearch::nextUniform() {
  random_ = random_ * 6364136223846793005ULL + 1442695040888963407ULL;
  return (static_cast<double>(random_ >> 11) + 0.5) / 9007199254740992.0;
}

double LeastReactionSearch::nextNormal() {
  const double radius = std::sqrt(-2.0 * std::log(nextUniform()));
  return radius * std::cos(2.0 * 3.141592653589793 * nextUniform());
}

void LeastReactionSearch::evaluate(double t, Point* point) {
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

double LeastReactionSearch::distance(const Point& p, double* slope) const {
  double sum = p.t * p.t;
  *slope = 2.0 * p.t;
  for (int r = 0; r < soft_; ++r) {
    sum += p.v[r] * p.v[r];
    *slope += 2.0 * p.v[r] * p.dv[r];
  }
  return sum;
}

double LeastReactionSearch::hardSquare(const Point& p, double* slope) const {
  double sum = 0.0;
  *slope = 0.0;
  for (int r = soft_; r < rowCount(); ++r) {
    sum += p.v[r] * p.v[r];
    *slope += 2.0 * p.v[r] * p.dv[r];
  }
  return sum;
}

bool LeastReactionSearch::lookThrough(int rays, bool is_coarse) {
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
    // noteWithin quarters each part: as many places as parts, for at most three minima.
    if (is_cubic_ && scanCubic(reach, parts / 4, ray == 0)) continue;
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

bool LeastReactionSearch::scanCubic(double reach, int parts, bool is_first) {
  Point center;
  Point end;
  evaluate(0.0, &center);
  evaluate(reach, &end);
  if (!center.is_finite || !end.is_finite) return false;
  if (is_first) noteStart(center, 0.0);
  Point from = center;
  for (int part = 1; part <= parts; ++part) {
    Point to;
    interpolate(center, end, static_cast<double>(part) / parts, &to);
    noteWithin(from, to);
    from = to;
  }
  return true;
}

void LeastReactionSearch::interpolate(const Point& a, const Point& b, double theta,
                                      Point* p) const {
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

void LeastReactionSearch::scan(const Point& a, const Point& b, int depth) {
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

void LeastReactionSearch::noteWithin(const Point& a, const Point& b) {
  constexpr int kParts = 4;
  const int hard = rowCount() - soft_;
  const auto slopeAt = [&](const Point& p) {
    double slope;
    if (hard == 0) {
      distance(p, &slope);
    } else {
      hardSquare(p, &slope);
    }
    return slope;
  };
  Point between[2];  // taking turns as the left end and the right one
  const Point* left = &a;
  double slope_left = slopeAt(a);
  for (int part = 1; part <= kParts; ++part) {
    const Point* right = &b;
    if (part < kParts) {
      Point* const next = &between[part % 2];
      interpolate(a, b, static_cast<double>(part) / kParts, next);
      right = next;
    }
    const double slope_right = slopeAt(*right);
    double theta = -1.0;
    double penalty = 1.0;
    if (hard == 1 && (left->v[soft_] < 0.0) != (right->v[soft_] < 0.0)) {
      theta = left->v[soft_] / (left->v[soft_] - right->v[soft_]);
    } else if (slope_left < 0.0 && slope_right >= 0.0) {
      theta = slope_left / (slope_left - slope_right);
      if (hard > 0) penalty = 4.0;
    }
    if (theta >= 0.0) {
      Point found;
      interpolate(*left, *right, theta, &found);
      noteStart(found, penalty);
    }
    left = right;
    slope_left = slope_right;
  }
}

void LeastReactionSearch::noteStart(const Point& point, double penalty) {
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

bool LeastReactionSearch::areNear(const double* a, const double* b, double apart) const {
  double change[kMaxShafts];
  for (int i = 0; i < S; ++i) change[i] = a[i] - b[i];
  return measure(change) <= apart * apart;
}

double LeastReactionSearch::measure(const double* v) const {
  double force[kMaxShafts];
  drivetrain_.inertia().multiply(v, force);
  double sum = 0.0;
  for (int i = 0; i < S; ++i) sum += v[i] * force[i];
  return sum;
}

}  // namespace variator_sim
