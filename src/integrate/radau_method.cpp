#include "integrate/radau_method.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace variator_sim {
namespace {

using LongReal = long double;
using Complex = std::complex<LongReal>;
using RealVector = std::vector<LongReal>;
using RealMatrix = std::vector<RealVector>;

/// The value of the polynomial whose coefficients are given from the constant one on.
template <class Number>
Number evaluate(const RealVector& coefficients, Number x) {
  Number sum = 0;
  for (std::size_t k = coefficients.size(); k-- > 0;) sum = sum * x + coefficients[k];
  return sum;
}

RealVector differentiate(const RealVector& coefficients) {
  RealVector slope;
  for (std::size_t k = 1; k < coefficients.size(); ++k) {
    slope.push_back(static_cast<LongReal>(k) * coefficients[k]);
  }
  return slope;
}

/// All roots at once, by Weierstrass's iteration.
std::vector<Complex> findRoots(const RealVector& coefficients) {
  constexpr int kIterations = 50;  // some twenty are enough
  const std::size_t count = coefficients.size() - 1;
  std::vector<Complex> roots(count, Complex(1));
  for (std::size_t i = 1; i < count; ++i) roots[i] = roots[i - 1] * Complex(0.4L, 0.9L);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (std::size_t i = 0; i < count; ++i) {
      Complex divisor = coefficients.back();
      for (std::size_t j = 0; j < count; ++j) {
        if (j != i) divisor *= roots[i] - roots[j];
      }
      roots[i] -= evaluate(coefficients, roots[i]) / divisor;
    }
  }
  return roots;
}

/// The polynomial that is zero at the points: the derivative of order s - 1 of
/// x^(s-1) (x - 1)^s.
RealVector makeRadauPolynomial(int stages) {
  RealVector coefficients;
  LongReal chosen = stages % 2 == 0 ? 1 : -1;  // binomials (s over j) of alternating sign
  for (int j = 0; j <= stages; ++j) {
    LongReal coefficient = chosen;
    for (int k = j + 1; k < stages + j; ++k) coefficient *= static_cast<LongReal>(k);
    coefficients.push_back(coefficient);
    chosen *= -static_cast<LongReal>(stages - j) / static_cast<LongReal>(j + 1);
  }
  return coefficients;
}

/// By elimination with pivots.
RealMatrix invert(RealMatrix a) {
  const std::size_t n = a.size();
  RealMatrix inverse(n, RealVector(n, 0));
  for (std::size_t i = 0; i < n; ++i) inverse[i][i] = 1;
  for (std::size_t column = 0; column < n; ++column) {
    std::size_t pivot = column;
    for (std::size_t row = column; row < n; ++row) {
      if (std::abs(a[row][column]) > std::abs(a[pivot][column])) pivot = row;
    }
    std::swap(a[pivot], a[column]);
    std::swap(inverse[pivot], inverse[column]);
    for (std::size_t row = 0; row < n; ++row) {
      if (row == column) continue;
      const LongReal part = a[row][column] / a[column][column];
      for (std::size_t j = 0; j < n; ++j) {
        a[row][j] -= part * a[column][j];
        inverse[row][j] -= part * inverse[column][j];
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (LongReal& entry : inverse[i]) entry /= a[i][i];
  }
  return inverse;
}

/// Row i: the slopes at point i of Lagrange's polynomials of the points and 0.
RealMatrix makeSlopes(const RealVector& points) {
  const std::size_t n = points.size();
  RealMatrix slopes(n, RealVector(n));
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      LongReal product = 1 / points[j];
      if (i == j) {
        for (std::size_t k = 0; k < n; ++k) {
          if (k != j) product += 1 / (points[j] - points[k]);
        }
      } else {
        product *= points[i] / (points[j] - points[i]);
        for (std::size_t k = 0; k < n; ++k) {
          if (k != i && k != j) product *= (points[i] - points[k]) / (points[j] - points[k]);
        }
      }
      slopes[i][j] = product;
    }
  }
  return slopes;
}

void copy(const RealMatrix& from, RadauMethod::Matrix& to) {
  for (std::size_t i = 0; i < from.size(); ++i) {
    for (std::size_t j = 0; j < from.size(); ++j) to[i][j] = static_cast<double>(from[i][j]);
  }
}

}  // namespace

const RadauMethod& RadauMethod::withStages(int stages) {
  static const RadauMethod kThree(3);
  static const RadauMethod kFive(5);
  static const RadauMethod kSeven(7);
  return stages == 3 ? kThree : stages == 5 ? kFive : kSeven;
}

// The eigenvector of A^-1 for the eigenvalue m is a polynomial of degree s with
//     p' - m p = M,  p(0) = 0,  M the polynomial of the points:
// p = -(M/m + M'/m^2 + ...), and m is a root of M(0) m^s + M'(0) m^(s-1) + ... = 0.
RadauMethod::RadauMethod(int stages) : stages_(stages) {
  const auto s = static_cast<std::size_t>(stages);
  std::vector<RealVector> derivatives{makeRadauPolynomial(stages)};
  while (derivatives.size() <= s) derivatives.push_back(differentiate(derivatives.back()));
  RealVector points;
  for (const Complex& root : findRoots(derivatives[0])) points.push_back(root.real());
  std::sort(points.begin(), points.end());
  points.back() = 1;

  RealVector characteristic(s + 1);
  for (std::size_t k = 0; k <= s; ++k)
    characteristic[s - k] = evaluate(derivatives[k], LongReal(0));
  RealMatrix T(s, RealVector(s));
  std::size_t columns = 1;
  for (const Complex& m : findRoots(characteristic)) {
    const bool is_real = std::abs(m.imag()) < 1e-9L;
    if (!is_real && m.imag() < 0) continue;
    // The eigenvector of a - ib: its parts are the columns of the block ((a, -b), (b, a)).
    const auto eigenvector = [&](LongReal theta) {
      Complex sum = 0;
      for (std::size_t k = s + 1; k-- > 0;) {
        sum = (sum + evaluate(derivatives[k], theta)) / std::conj(m);
      }
      return sum;
    };
    const Complex last = eigenvector(1);
    const std::size_t column = is_real ? 0 : columns;
    for (std::size_t i = 0; i < s; ++i) {
      const Complex value = eigenvector(points[i]) / last;
      T[i][column] = value.real();
      if (!is_real) T[i][column + 1] = value.imag();
    }
    if (is_real) {
      real_ = static_cast<double>(m.real());
    } else {
      pairs_[(columns - 1) / 2] = {static_cast<double>(m.real()), static_cast<double>(m.imag())};
      columns += 2;
    }
  }
  const RealMatrix inverse = makeSlopes(points);
  copy(inverse, inverse_);
  copy(invert(inverse), A_);
  copy(T, T_);
  copy(invert(T), inverse_transform_);
  for (std::size_t j = 0; j < s; ++j) {
    LongReal scale = 1 / points[j];
    for (std::size_t k = 0; k < s; ++k) {
      if (k != j) scale /= points[j] - points[k];
    }
    scale_[j] = static_cast<double>(scale);
    points_[j] = static_cast<double>(points[j]);
  }
}

void RadauMethod::calcValueWeights(double theta, Vector& weights) const {
  const auto s = static_cast<std::size_t>(stages_);
  double before = theta;
  for (std::size_t j = 0; j < s; ++j) {
    weights[j] = scale_[j] * before;
    before *= theta - points_[j];
  }
  double behind = 1.0;
  for (std::size_t j = s; j-- > 0;) {
    weights[j] *= behind;
    behind *= theta - points_[j];
  }
}

void RadauMethod::calcSlopeWeights(double theta, Vector& weights) const {
  const auto s = static_cast<std::size_t>(stages_);
  for (std::size_t j = 0; j < s; ++j) {
    // (product)' by its factors: theta and theta - c_k
    double value = theta;
    double slope = 1.0;
    for (std::size_t k = 0; k < s; ++k) {
      if (k == j) continue;
      slope = slope * (theta - points_[k]) + value;
      value *= theta - points_[k];
    }
    weights[j] = scale_[j] * slope;
  }
}

}  // namespace variator_sim
