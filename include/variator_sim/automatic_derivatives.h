/// Numbers that carry derivatives: forward automatic differentiation, exact to round-off.
///
/// A formula written once as a template, `template <class T> T f(const T& x)`, gives with
///     Dual<N>           f and its derivatives in N directions,
///     Dual<N, Dual<M>>  second derivatives too,
///     Curve<N>          f, its first and second derivative along a curve, and its gradient,
///     Dual<N, Curve<M>> the derivatives of all that: third derivatives of f.
/// Everything lies on the stack and every loop has a length known to the compiler. `Dual<0>` is a
/// plain number for which, as for the others, sin, abs, max, ... are found without naming a
/// namespace.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

namespace variator_sim {

/// A value and its derivatives in N directions; S is double, or a Dual or a Curve for higher
/// derivatives.
template <int N, class S = double>
struct Dual {
  S value;
  std::array<S, N> derivative;

  Dual() = default;
  /// A constant.
  Dual(double constant) : value(constant), derivative{} {}  // NOLINT(google-explicit-constructor)

  friend Dual operator+(const Dual& a) { return a; }
  friend Dual operator-(const Dual& a) { return combine(-a.value, a, -1.0); }
  friend Dual operator+(const Dual& a, double b) { return withValue(a.value + b, a); }
  friend Dual operator+(double a, const Dual& b) { return withValue(a + b.value, b); }
  friend Dual operator-(const Dual& a, double b) { return withValue(a.value - b, a); }
  friend Dual operator-(double a, const Dual& b) { return combine(a - b.value, b, -1.0); }
  friend Dual operator*(const Dual& a, double b) { return combine(a.value * b, a, b); }
  friend Dual operator*(double a, const Dual& b) { return combine(a * b.value, b, a); }
  friend Dual operator/(const Dual& a, double b) { return a * (1.0 / b); }
  friend Dual operator/(double a, const Dual& b) {
    const S q = a / b.value;
    return combine(q, b, -(q / b.value));
  }
  friend Dual operator+(const Dual& a, const Dual& b) {
    Dual sum;
    sum.value = a.value + b.value;
    for (std::size_t i = 0; i < N; ++i) sum.derivative[i] = a.derivative[i] + b.derivative[i];
    return sum;
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    Dual difference;
    difference.value = a.value - b.value;
    for (std::size_t i = 0; i < N; ++i) {
      difference.derivative[i] = a.derivative[i] - b.derivative[i];
    }
    return difference;
  }
  friend Dual operator*(const Dual& a, const Dual& b) {
    Dual product;
    product.value = a.value * b.value;
    for (std::size_t i = 0; i < N; ++i) {
      product.derivative[i] = a.value * b.derivative[i] + b.value * a.derivative[i];
    }
    return product;
  }
  friend Dual operator/(const Dual& a, const Dual& b) {
    Dual quotient;
    const S inverse = 1.0 / b.value;
    quotient.value = a.value * inverse;
    for (std::size_t i = 0; i < N; ++i) {
      quotient.derivative[i] = (a.derivative[i] - quotient.value * b.derivative[i]) * inverse;
    }
    return quotient;
  }

 private:
  static Dual withValue(const S& value, const Dual& like) {
    Dual result = like;
    result.value = value;
    return result;
  }
  /// The derivatives of `like`, times `factor`.
  template <class F>
  static Dual combine(const S& value, const Dual& like, const F& factor) {
    Dual result;
    result.value = value;
    for (std::size_t i = 0; i < N; ++i) result.derivative[i] = factor * like.derivative[i];
    return result;
  }
};

/// A value, its first and second derivative along a curve, and its gradient by N variables.
template <int N>
struct Curve {
  double value;
  double first;
  double second;
  std::array<double, N> gradient;

  Curve() = default;
  /// A constant.
  Curve(double constant)  // NOLINT(google-explicit-constructor)
      : value(constant), first(0.0), second(0.0), gradient{} {}

  friend Curve operator+(const Curve& a) { return a; }
  friend Curve operator-(const Curve& a) { return a * -1.0; }
  friend Curve operator+(const Curve& a, double b) {
    Curve sum = a;
    sum.value += b;
    return sum;
  }
  friend Curve operator+(double a, const Curve& b) { return b + a; }
  friend Curve operator-(const Curve& a, double b) { return a + (-b); }
  friend Curve operator-(double a, const Curve& b) { return -b + a; }
  friend Curve operator*(const Curve& a, double b) {
    Curve product;
    product.value = a.value * b;
    product.first = a.first * b;
    product.second = a.second * b;
    for (std::size_t i = 0; i < N; ++i) product.gradient[i] = a.gradient[i] * b;
    return product;
  }
  friend Curve operator*(double a, const Curve& b) { return b * a; }
  friend Curve operator/(const Curve& a, double b) { return a * (1.0 / b); }
  friend Curve operator/(double a, const Curve& b) { return Curve(a) / b; }
  friend Curve operator+(const Curve& a, const Curve& b) {
    Curve sum;
    sum.value = a.value + b.value;
    sum.first = a.first + b.first;
    sum.second = a.second + b.second;
    for (std::size_t i = 0; i < N; ++i) sum.gradient[i] = a.gradient[i] + b.gradient[i];
    return sum;
  }
  friend Curve operator-(const Curve& a, const Curve& b) {
    Curve difference;
    difference.value = a.value - b.value;
    difference.first = a.first - b.first;
    difference.second = a.second - b.second;
    for (std::size_t i = 0; i < N; ++i) difference.gradient[i] = a.gradient[i] - b.gradient[i];
    return difference;
  }
  friend Curve operator*(const Curve& a, const Curve& b) {
    Curve product;
    product.value = a.value * b.value;
    product.first = a.value * b.first + b.value * a.first;
    product.second = a.value * b.second + 2.0 * a.first * b.first + b.value * a.second;
    for (std::size_t i = 0; i < N; ++i) {
      product.gradient[i] = a.value * b.gradient[i] + b.value * a.gradient[i];
    }
    return product;
  }
  friend Curve operator/(const Curve& a, const Curve& b) {
    // a = q b, differentiated
    Curve q;
    const double inverse = 1.0 / b.value;
    q.value = a.value * inverse;
    q.first = (a.first - q.value * b.first) * inverse;
    q.second = (a.second - 2.0 * q.first * b.first - q.value * b.second) * inverse;
    for (std::size_t i = 0; i < N; ++i) {
      q.gradient[i] = (a.gradient[i] - q.value * b.gradient[i]) * inverse;
    }
    return q;
  }
};

template <class T>
struct IsAutomatic : std::false_type {};
template <int N, class S>
struct IsAutomatic<Dual<N, S>> : std::true_type {};
template <int N>
struct IsAutomatic<Curve<N>> : std::true_type {};
/// T, for numbers of this file only.
template <class T>
using Automatic = std::enable_if_t<IsAutomatic<T>::value, T>;
template <class T>
using AutomaticBool = std::enable_if_t<IsAutomatic<T>::value, bool>;

/// The value without its derivatives.
inline double realPart(double x) {
  return x;
}
template <class T>
std::enable_if_t<IsAutomatic<T>::value, double> realPart(const T& x) {
  return realPart(x.value);
}

/// True for numbers that ask a function of one variable for its third derivative.
template <class T>
struct NeedsThird : std::false_type {};
template <int N, int M>
struct NeedsThird<Dual<N, Curve<M>>> : std::true_type {};

/// g(x) for a function g of one variable with `g[0..3]` = g, g', g'', g''' at the value of x; of
/// them are read as many as x carries derivatives.
inline double chain(double /*x*/, const double* g) {
  return g[0];
}
template <int N>
Curve<N> chain(const Curve<N>& x, const double* g) {
  Curve<N> y;
  y.value = g[0];
  y.first = g[1] * x.first;
  y.second = g[1] * x.second + g[2] * x.first * x.first;
  for (std::size_t i = 0; i < N; ++i) y.gradient[i] = g[1] * x.gradient[i];
  return y;
}
template <int N, class S>
Dual<N, S> chain(const Dual<N, S>& x, const double* g) {
  Dual<N, S> y;
  y.value = chain(x.value, g);
  const S slope = chain(x.value, g + 1);
  for (std::size_t i = 0; i < N; ++i) y.derivative[i] = slope * x.derivative[i];
  return y;
}

/// g(x) for a function g of one variable, of which only the value and derivatives at the value of x
/// are known: a table, a library's function. Without the third derivative what is made of it is
/// NaN; AutomaticConstraint takes differences instead.
template <class T>
Automatic<T> compose(const T& x, double value, double slope, double curvature,
                     double third = std::numeric_limits<double>::quiet_NaN()) {
  const double g[] = {value, slope, curvature, third};
  return chain(x, g);
}
/// The same with `g[0..2]` = g, g', g''.
inline double compose(double /*x*/, const double* g) {
  return g[0];
}
template <class T>
Automatic<T> compose(const T& x, const double* g) {
  return compose(x, g[0], g[1], g[2]);
}

template <class T>
Automatic<T> sin(const T& x) {
  const double v = realPart(x);
  const double s = std::sin(v);
  const double c = std::cos(v);
  return compose(x, s, c, -s, -c);
}
template <class T>
Automatic<T> cos(const T& x) {
  const double v = realPart(x);
  const double c = std::cos(v);
  const double s = std::sin(v);
  return compose(x, c, -s, -c, s);
}
template <class T>
Automatic<T> tan(const T& x) {
  const double v = std::tan(realPart(x));
  const double slope = 1.0 + v * v;
  return compose(x, v, slope, 2.0 * v * slope, 2.0 * slope * (1.0 + 3.0 * v * v));
}
template <class T>
Automatic<T> asin(const T& x) {
  const double v = realPart(x);
  const double slope = 1.0 / std::sqrt(1.0 - v * v);
  const double cube = slope * slope * slope;
  return compose(x, std::asin(v), slope, v * cube, cube * (1.0 + 3.0 * v * v * slope * slope));
}
template <class T>
Automatic<T> acos(const T& x) {
  const double v = realPart(x);
  const double slope = -1.0 / std::sqrt(1.0 - v * v);
  const double cube = slope * slope * slope;
  return compose(x, std::acos(v), slope, v * cube, cube * (1.0 + 3.0 * v * v * slope * slope));
}
template <class T>
Automatic<T> atan(const T& x) {
  const double v = realPart(x);
  const double slope = 1.0 / (1.0 + v * v);
  return compose(x, std::atan(v), slope, -2.0 * v * slope * slope,
                 slope * slope * slope * (6.0 * v * v - 2.0));
}
template <class T>
Automatic<T> sinh(const T& x) {
  const double v = realPart(x);
  const double s = std::sinh(v);
  const double c = std::cosh(v);
  return compose(x, s, c, s, c);
}
template <class T>
Automatic<T> cosh(const T& x) {
  const double v = realPart(x);
  const double c = std::cosh(v);
  const double s = std::sinh(v);
  return compose(x, c, s, c, s);
}
template <class T>
Automatic<T> tanh(const T& x) {
  const double h = std::tanh(realPart(x));
  // 1/cosh^2; 1 - tanh^2 would lose all its digits where tanh is nearly 1.
  const double tail = std::exp(-2.0 * std::abs(realPart(x)));
  const double slope = 4.0 * tail / ((1.0 + tail) * (1.0 + tail));
  return compose(x, h, slope, -2.0 * h * slope, 2.0 * slope * (3.0 * h * h - 1.0));
}
template <class T>
Automatic<T> exp(const T& x) {
  const double v = std::exp(realPart(x));
  return compose(x, v, v, v, v);
}
template <class T>
Automatic<T> expm1(const T& x) {
  const double v = realPart(x);
  const double slope = std::exp(v);
  return compose(x, std::expm1(v), slope, slope, slope);
}
template <class T>
Automatic<T> log(const T& x) {
  const double v = realPart(x);
  return compose(x, std::log(v), 1.0 / v, -1.0 / (v * v), 2.0 / (v * v * v));
}
template <class T>
Automatic<T> log1p(const T& x) {
  const double v = realPart(x);
  const double slope = 1.0 / (1.0 + v);
  return compose(x, std::log1p(v), slope, -slope * slope, 2.0 * slope * slope * slope);
}
template <class T>
Automatic<T> sqrt(const T& x) {
  const double v = realPart(x);
  const double root = std::sqrt(v);
  return compose(x, root, 0.5 / root, -0.25 / (v * root), 0.375 / (v * v * root));
}
/// x^p for a constant p; x^0, x^1, x^2 and x^3 have their derivatives at x = 0 too.
template <class T>
Automatic<T> pow(const T& x, double p) {
  const double v = realPart(x);
  const double slope = p == 0.0 ? 0.0 : p * std::pow(v, p - 1.0);
  const double curvature = p == 0.0 || p == 1.0 ? 0.0 : p * (p - 1.0) * std::pow(v, p - 2.0);
  double third = 0.0;
  if constexpr (NeedsThird<T>::value) {  // no fourth power for those that do not read it
    if (p != 0.0 && p != 1.0 && p != 2.0) {
      third = p * (p - 1.0) * (p - 2.0) * std::pow(v, p - 3.0);
    }
  }
  return compose(x, std::pow(v, p), slope, curvature, third);
}
/// x^y for x > 0.
template <class T>
Automatic<T> pow(const T& x, const T& y) {
  return exp(y * log(x));
}
/// One-sided where it has a kink: the derivative at 0 is 0.
template <class T>
Automatic<T> abs(const T& x) {
  const double v = realPart(x);
  return compose(x, std::abs(v), v > 0.0 ? 1.0 : (v < 0.0 ? -1.0 : 0.0), 0.0, 0.0);
}
template <class T>
Automatic<T> atan2(const T& y, const T& x) {
  // turned by the angle itself: the remaining angle is 0, its derivatives are not
  const double y0 = realPart(y);
  const double x0 = realPart(x);
  return std::atan2(y0, x0) + atan((x0 * y - y0 * x) / (x0 * x + y0 * y));
}

template <class T>
AutomaticBool<T> operator<(const T& a, const T& b) {
  return realPart(a) < realPart(b);
}
template <class T>
AutomaticBool<T> operator<(const T& a, double b) {
  return realPart(a) < b;
}
template <class T>
AutomaticBool<T> operator<(double a, const T& b) {
  return a < realPart(b);
}
template <class T>
AutomaticBool<T> operator>(const T& a, const T& b) {
  return b < a;
}
template <class T>
AutomaticBool<T> operator>(const T& a, double b) {
  return b < a;
}
template <class T>
AutomaticBool<T> operator>(double a, const T& b) {
  return b < a;
}
template <class T>
AutomaticBool<T> operator<=(const T& a, double b) {
  return realPart(a) <= b;
}
template <class T>
AutomaticBool<T> operator>=(const T& a, double b) {
  return realPart(a) >= b;
}
template <class T>
Automatic<T> max(const T& a, const T& b) {
  return a < b ? b : a;
}
template <class T>
Automatic<T> max(const T& a, double b) {
  return a < b ? T(b) : a;
}
template <class T>
Automatic<T> min(const T& a, const T& b) {
  return b < a ? b : a;
}
template <class T>
Automatic<T> min(const T& a, double b) {
  return b < a ? T(b) : a;
}

}  // namespace variator_sim
