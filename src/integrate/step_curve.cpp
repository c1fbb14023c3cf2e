#include "integrate/step_curve.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {
namespace {

constexpr std::size_t kSize = StepCurve::kNodes;
constexpr std::size_t kDegree = kSize - 1;
using Row = std::array<double, kSize>;
using Matrix = std::array<Row, kSize>;

/// Chebyshev's points of the second kind, from 0 to 1: interpolation through them is well-behaved.
Row makeNodes() {
  Row nodes{};
  for (std::size_t i = 0; i < kSize; ++i) {
    const double angle = 3.14159265358979323846 * static_cast<double>(i) / kDegree;
    nodes[i] = 0.5 - 0.5 * std::cos(angle);
  }
  nodes.back() = 1.0;
  return nodes;
}

double binomial(std::size_t n, std::size_t k) {
  double value = 1.0;
  for (std::size_t i = 0; i < k; ++i) {
    value *= static_cast<double>(n - i) / static_cast<double>(i + 1);
  }
  return value;
}

/// From values at the nodes to Bernstein coefficients: the inverse of B_j(theta_i), by Gauss and
/// Jordan.
Matrix makeTransform(const Row& nodes) {
  Matrix left{};
  Matrix right{};
  for (std::size_t i = 0; i < kSize; ++i) {
    for (std::size_t j = 0; j < kSize; ++j) {
      left[i][j] = binomial(kDegree, j) * std::pow(nodes[i], static_cast<double>(j)) *
                   std::pow(1.0 - nodes[i], static_cast<double>(kDegree - j));
    }
    right[i][i] = 1.0;
  }
  for (std::size_t k = 0; k < kSize; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < kSize; ++i) {
      if (std::abs(left[i][k]) > std::abs(left[pivot][k])) pivot = i;
    }
    std::swap(left[k], left[pivot]);
    std::swap(right[k], right[pivot]);
    const double scale = 1.0 / left[k][k];
    for (std::size_t j = 0; j < kSize; ++j) {
      left[k][j] *= scale;
      right[k][j] *= scale;
    }
    for (std::size_t i = 0; i < kSize; ++i) {
      if (i == k) continue;
      const double factor = left[i][k];
      for (std::size_t j = 0; j < kSize; ++j) {
        left[i][j] -= factor * left[k][j];
        right[i][j] -= factor * right[k][j];
      }
    }
  }
  return right;
}

struct Basis {
  Row nodes = makeNodes();
  Matrix transform = makeTransform(nodes);
};
const Basis& basis() {
  static const Basis made;
  return made;
}

/// Bernstein coefficients of (d/dtheta)/duration of a polynomial of degree kDegree.
void differentiate(const Row& b, double duration, double* slope) {
  const double scale = static_cast<double>(kDegree) / duration;
  for (std::size_t i = 0; i < kDegree; ++i) slope[i] = scale * (b[i + 1] - b[i]);
}

/// The same polynomial, of `degree`, as one of the next degree.
void elevate(double* b, std::size_t degree) {
  b[degree + 1] = b[degree];
  for (std::size_t i = degree; i > 0; --i) {
    const double part = static_cast<double>(i) / static_cast<double>(degree + 1);
    b[i] = part * b[i - 1] + (1.0 - part) * b[i];
  }
}

/// The Bernstein coefficients of the polynomial of degree 2 m - 1 that has the first m of
/// `derivatives` (of theta: h^j f^(j)) at either end.
void makeHermite(const double* at_from, const double* at_to, std::size_t m, double* b) {
  const std::size_t n = 2 * m - 1;
  for (std::size_t i = 0; i < m; ++i) {
    double left = 0.0;
    double right = 0.0;
    double factor = 1.0;  // (n - j)!/n! times binomial(i, j)
    for (std::size_t j = 0; j <= i; ++j) {
      left += factor * at_from[j];
      right += (j % 2 == 0 ? factor : -factor) * at_to[j];
      if (j < i) factor *= static_cast<double>(i - j) / static_cast<double>((j + 1) * (n - j));
    }
    b[i] = left;
    b[n - i] = right;
  }
}

/// The range of a function with m derivatives (0 to m - 1) known at both ends, as polynomials of
/// degree 2 m - 1 and 2 m - 3 tell: the former, widened by how far they are apart.
Interval encloseHermite(const double* at_from, const double* at_to, std::size_t m) {
  double high[8];
  double low[8];
  const std::size_t n = 2 * m - 1;
  makeHermite(at_from, at_to, m, high);
  makeHermite(at_from, at_to, m - 1, low);
  for (std::size_t degree = n - 2; degree < n; ++degree) elevate(low, degree);
  double doubt = 0.0;
  for (std::size_t i = 0; i <= n; ++i) doubt = std::max(doubt, std::abs(high[i] - low[i]));
  const auto range = std::minmax_element(high, high + n + 1);
  return {*range.first - doubt, *range.second + doubt};
}

}  // namespace

void encloseStep(int shafts, const CurveEnd& from, const CurveEnd& to, double duration,
                 StateBox* box) {
  const double h = duration;
  for (int i = 0; i < shafts; ++i) {
    const bool full = from.jerk != nullptr;
    const double a[] = {from.angle[i], h * from.velocity[i], h * h * from.acceleration[i],
                        full ? h * h * h * from.jerk[i] : 0.0};
    const double b[] = {to.angle[i], h * to.velocity[i], h * h * to.acceleration[i],
                        full ? h * h * h * to.jerk[i] : 0.0};
    const std::size_t known = full ? 4 : 3;
    const auto scaled = [](Interval range, double by) {
      return Interval{range.low / by, range.high / by};
    };
    box->angle[i] = encloseHermite(a, b, known);
    box->velocity[i] = scaled(encloseHermite(a + 1, b + 1, known - 1), h);
    if (full) {
      box->acceleration[i] = scaled(encloseHermite(a + 2, b + 2, 2), h * h);
      continue;
    }
    // The slopes of the cubic of omega: a parabola through both ends and its middle coefficient.
    const double middle =
        3.0 * (to.velocity[i] - from.velocity[i]) / h - from.acceleration[i] - to.acceleration[i];
    const double chord = 0.5 * (from.acceleration[i] + to.acceleration[i]);
    const double doubt = std::abs(middle - chord);
    const double low = std::min({from.acceleration[i], to.acceleration[i], middle});
    const double high = std::max({from.acceleration[i], to.acceleration[i], middle});
    box->acceleration[i] = {low - doubt, high + doubt};
  }
}

double StepCurve::node(int index) {
  return basis().nodes[static_cast<std::size_t>(index)];
}

void StepCurve::begin(double time, double duration, int shafts, bool has_accelerations) {
  time_ = time;
  duration_ = duration;
  shafts_ = shafts;
  has_accelerations_ = has_accelerations;
  const std::size_t parts = has_accelerations ? 3 : 2;
  count_ = parts * static_cast<std::size_t>(shafts);
}

void StepCurve::setNode(int index, const double* x) {
  for (std::size_t n = 0; n < count_; ++n) {
    if (index == 0) origin_[n] = x[n];
    component_[n][static_cast<std::size_t>(index)] = x[n] - origin_[n];
  }
}

void StepCurve::finish() {
  const Matrix& transform = basis().transform;
  for (std::size_t n = 0; n < count_; ++n) {
    const Coefficients values = component_[n];
    for (std::size_t i = 0; i < kSize; ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < kSize; ++j) sum += transform[i][j] * values[j];
      component_[n][i] = sum;
    }
  }
}

StepCurve::Coefficients StepCurve::part(int index, double* origin) const {
  const auto shaft = static_cast<std::size_t>(index % kMaxShafts);
  const int kind = index / kMaxShafts;
  const auto s = static_cast<std::size_t>(shafts_);
  if (kind < 2 || has_accelerations_) {
    const std::size_t n = static_cast<std::size_t>(kind) * s + shaft;
    *origin = origin_[n];
    return component_[n];
  }
  *origin = 0.0;
  Row slope{};
  differentiate(component_[s + shaft], duration_, slope.data());
  elevate(slope.data(), kDegree - 1);
  return slope;
}

void StepCurve::enclose(StateBox* box) const {
  box->time = {time_, time_ + duration_};
  for (int kind = 0; kind < 3; ++kind) {
    for (int i = 0; i < shafts_; ++i) {
      double origin;
      const Coefficients own = part(kind * kMaxShafts + i, &origin);
      *partOf(box, kind * kMaxShafts + i) = rangeOf(own, origin);
    }
  }
}

Interval* StepCurve::partOf(StateBox* box, int index) {
  const int kind = index / kMaxShafts;
  // (A pointer: GCC's UBSan takes such a choice between arrays for a copy of one.)
  Interval* const parts = kind == 0 ? box->angle : kind == 1 ? box->velocity : box->acceleration;
  return parts + index % kMaxShafts;
}

Interval StepCurve::rangeOf(const Coefficients& whole, double origin) {
  const auto [low, high] = std::minmax_element(whole.begin(), whole.end());
  return {origin + *low, origin + *high};
}

StepCurve::Coefficients StepCurve::combine(const LinearValue& form, double* size) const {
  Coefficients sum{};
  *size = std::abs(form.time) * (std::abs(time_) + duration_);
  for (std::size_t j = 0; j < kSize; ++j) {
    sum[j] = form.time * duration_ * static_cast<double>(j) / kDegree;
  }
  for (int n = 0; n < 3 * kMaxShafts; ++n) {
    if (form.state[n] == 0.0 || n % kMaxShafts >= shafts_) continue;
    double origin;
    const Coefficients own = part(n, &origin);
    const double first = own[0];  // the value at the step's start is known better
    double largest = 0.0;
    for (std::size_t j = 0; j < kSize; ++j) {
      sum[j] += form.state[n] * (own[j] - first);
      largest = std::max(largest, std::abs(origin + own[j]));
    }
    *size += std::abs(form.state[n]) * largest;
  }
  return sum;
}

void StepCurve::halve(Coefficients& whole, Coefficients* earlier) {
  Row work = whole;
  for (std::size_t level = 0; level < kSize; ++level) {
    (*earlier)[level] = work[0];
    whole[kDegree - level] = work[kDegree - level];
    for (std::size_t i = 0; i + level < kDegree; ++i) work[i] = 0.5 * (work[i] + work[i + 1]);
  }
}

StepCurve::Coefficients StepCurve::head(const Coefficients& whole, double part) {
  if (part == 1.0) return whole;
  Row work = whole;
  Coefficients head{};
  for (std::size_t level = 0; level < kSize; ++level) {
    head[level] = work[0];
    for (std::size_t i = 0; i + level < kDegree; ++i) work[i] += part * (work[i + 1] - work[i]);
  }
  return head;
}

double StepCurve::valueAt(const Coefficients& whole, double part, double* slope) {
  Row work = whole;
  for (std::size_t level = kDegree; level > 1; --level) {
    for (std::size_t i = 0; i < level; ++i) work[i] += part * (work[i + 1] - work[i]);
  }
  *slope = static_cast<double>(kDegree) * (work[1] - work[0]);
  return work[0] + part * (work[1] - work[0]);
}

void StepCurve::evaluate(double part, double* angle, double* velocity, double* acceleration) const {
  const auto s = static_cast<std::size_t>(shafts_);
  for (std::size_t n = 0; n < count_; ++n) {
    double slope;
    double* const place = n < s ? angle : n < 2 * s ? velocity : acceleration;
    place[n % s] = origin_[n] + valueAt(component_[n], part, &slope);
    if (n >= s && !has_accelerations_) acceleration[n - s] = slope / duration_;
  }
}

}  // namespace variator_sim
