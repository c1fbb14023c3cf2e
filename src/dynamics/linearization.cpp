#include "dynamics/linearization.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "dynamics/system.h"
#include "model/central_difference.h"

namespace variator_sim {

Linearization::Linearization(int shafts, int levels)
    : S(shafts),
      L(levels),
      mass_(SquareMatrix::Identity(shafts, shafts)),
      projector_(SquareMatrix::Identity(shafts, shafts)),
      pull_(SquareMatrix::Zero(shafts, shafts)) {
  for (SquareMatrix& E : E_) E.resize(shafts, shafts);
}

double Linearization::calcFastestRate() const {
  constexpr int kIterations = 48;
  constexpr int kCounted = 24;  // the last powers, when the fastest component dominates
  State x(L * S);
  for (int n = 0; n < x.size(); ++n) x[n] = 1.0 / (n + 1);
  double log_growth = 0.0;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    double last[kMaxShafts] = {};
    for (int l = 0; l < L; ++l) {
      const SquareMatrix& E = block(l);
      for (int i = 0; i < S; ++i) {
        double sum = E(i, 0) * x[l * S];
        for (int j = 1; j < S; ++j) sum += E(i, j) * x[l * S + j];
        last[i] += sum;
      }
    }
    std::copy(x.begin() + S, x.end(), x.begin());
    std::copy_n(last, S, x.end() - S);
    double size = 0.0;
    for (double value : x) size = std::max(size, std::abs(value));
    if (!(size > 0.0)) return 0.0;
    for (double& value : x) value /= size;
    if (iteration >= kIterations - kCounted) log_growth += std::log(size);
  }
  return std::exp(log_growth / kCounted);
}

// Matrices of up to kInverted rows are inverted, with their size known at compile time.
namespace {
constexpr int kInverted = 4;

/// Multiplies without the checks for infinities of std::complex's operator.
double multiply(double a, double b) {
  return a * b;
}
std::complex<double> multiply(std::complex<double> a, std::complex<double> b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
double invert(double a) {
  return 1.0 / a;
}
std::complex<double> invert(std::complex<double> a) {
  return std::conj(a) * (1.0 / std::norm(a));
}
/// Returns f(x + d) - f(x - d) from its two halves. With a jump or a kink between, the smaller half
/// has the mode of x.
double differenceOf(double forward, double backward) {
  constexpr double kUnlike = 10.0;
  const double larger = std::max(std::abs(forward), std::abs(backward));
  const double smaller = std::min(std::abs(forward), std::abs(backward));
  if (!(larger > kUnlike * smaller)) return forward + backward;
  return 2.0 * (std::abs(forward) < std::abs(backward) ? forward : backward);
}

}  // namespace

template <int kShafts, class Scalar>
bool Linearization::factorSized(Factors<Scalar>& factors, Scalar g) {
  constexpr int kSize = kShafts > kInverted ? Eigen::Dynamic : kShafts;
  constexpr int kRoom = kShafts > kInverted ? kMaxShafts : kShafts;
  using Real = Eigen::Matrix<double, kSize, kSize, 0, kRoom, kRoom>;
  using Matrix = Eigen::Matrix<Scalar, kSize, kSize, 0, kRoom, kRoom>;
  factors.g = g;
  const Scalar inverse_g = invert(g);
  Matrix W = Eigen::Map<const Real>(mass_.data(), S, S) * inverse_g;
  Scalar power = 1.0;
  for (int l = L; l-- > 0; power = multiply(power, g)) {
    W -= power * Eigen::Map<const Real>(block(l).data(), S, S);
  }
  if (!W.allFinite()) return false;
  if constexpr (kShafts <= kInverted) {
    Eigen::Map<Matrix> inverse(factors.inverse.data());
    inverse = W.inverse();
    return inverse.allFinite();
  } else {
    factors.lu.factor(W.data(), S);
    return true;
  }
}

template <int kShafts, class Scalar>
void Linearization::solveSized(const Factors<Scalar>& factors, Scalar* r) const {
  if (L == 2) return solveLevels<kShafts, 2>(factors, r);
  return solveLevels<kShafts, 3>(factors, r);
}

template <int kShafts, int kLevels, class Scalar>
void Linearization::solveLevels(const Factors<Scalar>& factors, Scalar* r) const {
  constexpr bool kIsInverted = kShafts <= kInverted;
  const int s = kIsInverted ? kShafts : S;
  const Scalar g = factors.g;
  Scalar* last = r + (kLevels - 1) * s;
  // p_l = g (r_l + p_{l+1}): k_l without its part in k_{L-1}
  Scalar p[kShafts];
  Scalar right[kShafts];
  for (int i = 0; i < s; ++i) p[i] = 0.0;
  for (int i = 0; i < s; ++i) right[i] = last[i];
  for (int l = kLevels - 1; l-- > 0;) {
    const double* E = block(l).data();
    for (int i = 0; i < s; ++i) p[i] = multiply(g, r[l * s + i] + p[i]);
    for (int i = 0; i < s; ++i) {
      Scalar sum = E[i] * p[0];
      for (int j = 1; j < s; ++j) sum += E[i + j * s] * p[j];
      right[i] += sum;
    }
  }
  if constexpr (kIsInverted) {
    for (int i = 0; i < s; ++i) {
      const Scalar* W = factors.inverse.data();
      Scalar sum = multiply(W[i], right[0]);
      for (int j = 1; j < s; ++j) {
        sum += multiply(W[i + j * s], right[j]);
      }
      last[i] = sum;
    }
  } else {
    for (int i = 0; i < s; ++i) last[i] = right[i];
    factors.lu.solve(last);
  }
  for (int l = kLevels - 1; l-- > 0;) {
    for (int i = 0; i < s; ++i) r[l * s + i] = multiply(g, r[l * s + i] + r[(l + 1) * s + i]);
  }
}

template <class Scalar>
bool Linearization::factor(Factors<Scalar>& factors, Scalar g) {
  switch (S) {
    case 1:
      return factorSized<1>(factors, g);
    case 2:
      return factorSized<2>(factors, g);
    case 3:
      return factorSized<3>(factors, g);
    case 4:
      return factorSized<4>(factors, g);
    default:
      return factorSized<kMaxShafts>(factors, g);
  }
}
template <class Scalar>
void Linearization::solve(const Factors<Scalar>& factors, Scalar* r) const {
  switch (S) {
    case 1:
      return solveSized<1>(factors, r);
    case 2:
      return solveSized<2>(factors, r);
    case 3:
      return solveSized<3>(factors, r);
    case 4:
      return solveSized<4>(factors, r);
    default:
      return solveSized<kMaxShafts>(factors, r);
  }
}

bool Linearization::factor(double g) {
  return factor(real_, g);
}
bool Linearization::factorComplex(int index, Complex g) {
  return factor(complex_[static_cast<std::size_t>(index)], g);
}
void Linearization::solve(State& r) const {
  solve(real_, r.data());
}
void Linearization::solveComplex(int index, ComplexState& r) const {
  solve(complex_[static_cast<std::size_t>(index)], r.data());
}

void linearizeByDifferences(System& system, double t, const State& x, bool reads_angles,
                            double natural_size, Linearization& linearization) {
  const int S = linearization.shafts();
  const int L = linearization.levels();
  State shifted = x;
  State above(x.size());
  State below(x.size());
  State here(x.size());
  system(x, here, t);
  for (int l = 0; l < L; ++l) {
    if (l == 0 && !reads_angles) {
      linearization.block(0).setZero();
      continue;
    }
    for (int j = 0; j < S; ++j) {
      const int n = S * l + j;
      const double step = calcShift(x.data() + l * S, S, j, l == 0, natural_size);
      shifted[n] = x[n] + step;
      const double upper = shifted[n];
      system(shifted, above, t);
      shifted[n] = x[n] - step;
      const double lower = shifted[n];
      system(shifted, below, t);
      shifted[n] = x[n];
      for (int i = 0; i < S; ++i) {
        const int row = S * (L - 1) + i;
        const double forward = above[row] - here[row];
        const double backward = here[row] - below[row];
        linearization.block(l)(i, j) = differenceOf(forward, backward) / (upper - lower);
      }
    }
  }
}

}  // namespace variator_sim
