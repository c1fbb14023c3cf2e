// The ball of two dimensions where psi is a cubic: nothing in it is left out. With x in units of
// the ball's radius
//     v(x, y) = sum c_ij x^i y^j,   i + j <= 3
// and a box is looked into only while its intervals allow all of
//     |x|^2 + |v|^2 no more than the ball's,   hard = 0,
//     d = x + v grad v:   d = 0, or along one hard row d x grad hard = 0 (a least distance).
#include <algorithm>
#include <cmath>

#include "dynamics/least_reaction_search.h"

namespace variator_sim {

namespace {

/// A value and how far others in a box may be from it.
struct Spread {
  double middle = 0.0;
  double radius = 0.0;
  bool hasZero() const { return !(std::abs(middle) > radius); }
  /// The least |value|.
  double least() const { return std::max(0.0, std::abs(middle) - radius); }
};

Spread operator+(const Spread& a, const Spread& b) {
  return {a.middle + b.middle, a.radius + b.radius};
}
Spread operator-(const Spread& a, const Spread& b) {
  return {a.middle - b.middle, a.radius + b.radius};
}
Spread operator*(const Spread& a, const Spread& b) {
  return {a.middle * b.middle,
          std::abs(a.middle) * b.radius + a.radius * (std::abs(b.middle) + b.radius)};
}

}  // namespace

/// c[i][j] of x^i y^j.
struct LeastReactionSearch::Cubic {
  double c[4][4] = {};
  double noise = 0.0;

  /// Value and gradient within `w` of (x, y) in either direction.
  void enclose(double x, double y, double w, Spread* value, Spread* by_x, Spread* by_y) const {
    const double xx =
        3.0 * c[3][0] * x + c[2][1] * y + c[2][0];  // the halves of second derivatives
    const double yy = 3.0 * c[0][3] * y + c[1][2] * x + c[0][2];
    const double xy = 2.0 * (c[2][1] * x + c[1][2] * y) + c[1][1];
    const double third_x = 3.0 * std::abs(c[3][0]) + 2.0 * std::abs(c[2][1]) + std::abs(c[1][2]);
    const double third_y = 3.0 * std::abs(c[0][3]) + 2.0 * std::abs(c[1][2]) + std::abs(c[2][1]);
    const double thirds =
        std::abs(c[3][0]) + std::abs(c[2][1]) + std::abs(c[1][2]) + std::abs(c[0][3]);
    by_x->middle = c[1][0] + x * (2.0 * c[2][0] + 3.0 * c[3][0] * x + 2.0 * c[2][1] * y) +
                   y * (c[1][1] + c[1][2] * y);
    by_y->middle = c[0][1] + y * (2.0 * c[0][2] + 3.0 * c[0][3] * y + 2.0 * c[1][2] * x) +
                   x * (c[1][1] + c[2][1] * x);
    value->middle =
        c[0][0] + x * (c[1][0] + x * (c[2][0] + x * c[3][0])) +
        y * (c[0][1] + x * (c[1][1] + x * c[2][1]) + y * (c[0][2] + x * c[1][2] + y * c[0][3]));
    by_x->radius = w * (2.0 * std::abs(xx) + std::abs(xy) + w * third_x) + noise;
    by_y->radius = w * (2.0 * std::abs(yy) + std::abs(xy) + w * third_y) + noise;
    value->radius = w * (std::abs(by_x->middle) + std::abs(by_y->middle) +
                         w * (std::abs(xx) + std::abs(yy) + std::abs(xy) + w * thirds)) +
                    noise;
  }
};

void LeastReactionSearch::aimAt(double x, double y) {
  for (int i = 0; i < S; ++i) along_[i] = E_(i, 0) * x + E_(i, 1) * y;
}

bool LeastReactionSearch::fitCubics(double reach, Cubic* cubics) {
  // Along a direction d of length 1 with u = t / reach: v = v_0 + v_1 u + v_2 u^2 + v_3 u^3.
  constexpr double kHalf = 0.70710678118654752;
  constexpr double kDirections[4][2] = {{1.0, 0.0}, {0.0, 1.0}, {kHalf, kHalf}, {kHalf, -kHalf}};
  Point center[4];
  Point end[4];
  for (int n = 0; n < 4; ++n) {
    aimAt(kDirections[n][0], kDirections[n][1]);
    if (n < 2) evaluate(0.0, &center[n]);
    evaluate(reach, &end[n]);
    if (!center[n].is_finite && n < 2) return false;
    if (!end[n].is_finite) return false;
  }
  for (int r = 0; r < rowCount(); ++r) {
    Cubic& it = cubics[r];
    double second[4];
    double third[4];
    const double slope_x = center[0].dv[r];
    const double slope_y = center[1].dv[r];
    for (int n = 0; n < 4; ++n) {
      const double first = kDirections[n][0] * slope_x + kDirections[n][1] * slope_y;
      const double rise = end[n].v[r] - center[0].v[r] - reach * first;
      const double turn = reach * (end[n].dv[r] - first);
      second[n] = 3.0 * rise - turn;
      third[n] = turn - 2.0 * rise;
    }
    it.c[0][0] = center[0].v[r];
    it.c[1][0] = reach * slope_x;
    it.c[0][1] = reach * slope_y;
    it.c[2][0] = second[0];
    it.c[0][2] = second[1];
    it.c[1][1] = second[2] - second[3];
    it.c[3][0] = third[0];
    it.c[0][3] = third[1];
    it.c[1][2] = 2.0 * kHalf * (third[2] + third[3]) - third[0];
    it.c[2][1] = 2.0 * kHalf * (third[2] - third[3]) - third[1];
    double size = 0.0;
    for (const auto& part : it.c) {
      for (const double coefficient : part) size += std::abs(coefficient);
    }
    it.noise = kCubicNoise * size;
  }
  return true;
}

bool LeastReactionSearch::lookThroughPlane() {
  start_count_ = 0;
  noted_ = 0;
  looked_rays_ = 1;
  const double reach = radius();
  Cubic cubics[kMaxRows];
  if (!fitCubics(reach, cubics)) return false;
  const double unit = 1.0 / reach;  // of the soft rows' v, which are distances
  const int hard = rowCount() - soft_;
  struct Box {
    double x;
    double y;
    double w;
  };
  Box boxes[4 * kPlaneDepth + 1];
  int count = 0;
  boxes[count++] = {0.0, 0.0, 1.0};
  while (count > 0) {
    const Box box = boxes[--count];
    Spread value;
    Spread by_x;
    Spread by_y;
    Spread d_x = {box.x, box.w};
    Spread d_y = {box.y, box.w};
    double least = d_x.least() * d_x.least() + d_y.least() * d_y.least();
    Point center;
    for (int r = 0; r < soft_; ++r) {
      cubics[r].enclose(box.x, box.y, box.w, &value, &by_x, &by_y);
      center.v[r] = value.middle;
      const Spread part = {unit * value.middle, unit * value.radius};
      least += part.least() * part.least();
      d_x = d_x + part * Spread{unit * by_x.middle, unit * by_x.radius};
      d_y = d_y + part * Spread{unit * by_y.middle, unit * by_y.radius};
    }
    bool may_be = least <= 1.0 + kSame;
    for (int r = soft_; r < rowCount() && may_be; ++r) {
      cubics[r].enclose(box.x, box.y, box.w, &value, &by_x, &by_y);
      may_be = value.hasZero();
    }
    if (hard == 0) {
      may_be = may_be && d_x.hasZero() && d_y.hasZero();
    } else if (hard == 1) {
      may_be = may_be && (d_x * by_y - d_y * by_x).hasZero();
    }
    if (!may_be) continue;
    if (box.w > kPlaneLeaf) {
      const double w = 0.5 * box.w;
      for (const double x : {box.x - w, box.x + w}) {
        for (const double y : {box.y - w, box.y + w}) boxes[count++] = {x, y, w};
      }
      continue;
    }
    const double length = std::hypot(box.x, box.y);  // no leaf has its middle at 0
    aimAt(box.x / length, box.y / length);
    center.t = reach * length;
    center.is_finite = true;
    noteStart(center, 1.0);
  }
  return true;
}

}  // namespace variator_sim
