/// Forward derivatives of scenes.h's functions: exact Jacobians for implicit peers and references.
#pragma once

#include <array>
#include <cmath>

namespace variator_sim::benchmark {

/// A value and its derivatives with respect to N variables.
template <class T, int N>
struct Dual {
  T value{};
  std::array<T, N> derivative{};

  Dual() = default;
  Dual(T v) : value(v) {}  // NOLINT(google-explicit-constructor): constants of formulas
  static Dual variable(T v, int index) {
    Dual x(v);
    x.derivative[static_cast<std::size_t>(index)] = T(1);
    return x;
  }

  /// f(x) with f' = slope.
  Dual chain(T v, T slope) const {
    Dual y(v);
    for (std::size_t i = 0; i < N; ++i) y.derivative[i] = slope * derivative[i];
    return y;
  }
  Dual operator-() const { return chain(-value, T(-1)); }
  Dual& operator+=(const Dual& b) {
    value += b.value;
    for (std::size_t i = 0; i < N; ++i) derivative[i] += b.derivative[i];
    return *this;
  }
  Dual& operator-=(const Dual& b) {
    value -= b.value;
    for (std::size_t i = 0; i < N; ++i) derivative[i] -= b.derivative[i];
    return *this;
  }
  Dual& operator+=(T b) {
    value += b;
    return *this;
  }
  Dual& operator-=(T b) {
    value -= b;
    return *this;
  }

  friend Dual operator+(Dual a, const Dual& b) { return a += b; }
  friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
  friend Dual operator+(Dual a, T b) { return a += b; }
  friend Dual operator+(T a, Dual b) { return b += a; }
  friend Dual operator-(Dual a, T b) { return a -= b; }
  friend Dual operator-(T a, const Dual& b) { return -b + a; }
  friend Dual operator*(const Dual& a, T b) { return a.chain(a.value * b, b); }
  friend Dual operator*(T a, const Dual& b) { return b * a; }
  friend Dual operator*(const Dual& a, const Dual& b) {
    Dual y(a.value * b.value);
    for (std::size_t i = 0; i < N; ++i) {
      y.derivative[i] = a.derivative[i] * b.value + a.value * b.derivative[i];
    }
    return y;
  }
  friend Dual operator/(const Dual& a, T b) { return a * (T(1) / b); }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const T inverse = T(1) / b.value;
    Dual y(a.value * inverse);
    for (std::size_t i = 0; i < N; ++i) {
      y.derivative[i] = (a.derivative[i] - y.value * b.derivative[i]) * inverse;
    }
    return y;
  }
  friend Dual operator/(T a, const Dual& b) { return Dual(a) / b; }
  friend Dual sin(const Dual& a) { return a.chain(std::sin(a.value), std::cos(a.value)); }
  friend Dual exp(const Dual& a) {
    const T e = std::exp(a.value);
    return a.chain(e, e);
  }
  friend Dual sqrt(const Dual& a) {
    const T root = std::sqrt(a.value);
    return a.chain(root, T(0.5) / root);
  }
  friend Dual tanh(const Dual& a) {
    const T y = std::tanh(a.value);
    return a.chain(y, (T(1) - y) * (T(1) + y));
  }
  friend Dual cos(const Dual& a) { return a.chain(std::cos(a.value), -std::sin(a.value)); }
};

/// df/dx of x' = f(t, x), entry (i, j) at jacobian[i + N j], and df/dt; `rates(t, x, dxdt)`
/// computes f over dual numbers.
template <int N, class Rates>
inline void differentiate(const Rates& rates, double t, const double* x, double* jacobian,
                          double* dfdt) {
  using Number = Dual<double, N + 1>;
  Number y[N];
  Number dydt[N];
  for (int i = 0; i < N; ++i) y[i] = Number::variable(x[i], i);
  rates(Number::variable(t, N), y, dydt);
  for (int i = 0; i < N; ++i) {
    const auto& row = dydt[i].derivative;
    for (int j = 0; j < N; ++j) jacobian[i + N * j] = row[static_cast<std::size_t>(j)];
    dfdt[i] = row[N];
  }
}

/// The type of a formula's constants: a dual number's would carry derivatives that are all zero.
template <class R>
struct ConstantOf {
  using Type = R;
};
template <class T, int N>
struct ConstantOf<Dual<T, N>> {
  using Type = T;
};

}  // namespace variator_sim::benchmark
