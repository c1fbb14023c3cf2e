/// Numbers with their derivatives by P parameters (forward differentiation): f(x + dx) = f(x) + f'
/// dx. Comparisons, and conversions to double, take the value alone.
#pragma once

#include <cmath>
#include <type_traits>

namespace variator_sim {

template <int P>
struct Tangent {
  double value;
  double slope[P];

  Tangent() = default;
  Tangent(double of) : value(of), slope{} {}  // NOLINT: a constant
  operator double() const { return value; }   // NOLINT: the value decides

  bool isConstant() const {
    double sum = 0.0;
    for (int j = 0; j < P; ++j) sum += std::abs(slope[j]);
    return sum == 0.0;
  }
  /// Returns x with the slope f dx + g dy.
  static Tangent make(double x, double f, const Tangent& dx, double g, const Tangent& dy) {
    Tangent made;
    made.value = x;
    for (int j = 0; j < P; ++j) made.slope[j] = f * dx.slope[j] + g * dy.slope[j];
    return made;
  }
  static Tangent make(double x, double f, const Tangent& dx) {
    Tangent made;
    made.value = x;
    for (int j = 0; j < P; ++j) made.slope[j] = f * dx.slope[j];
    return made;
  }

  friend Tangent operator-(const Tangent& a) { return make(-a.value, -1.0, a); }
  friend Tangent operator+(const Tangent& a, const Tangent& b) {
    return make(a.value + b.value, 1.0, a, 1.0, b);
  }
  friend Tangent operator-(const Tangent& a, const Tangent& b) {
    return make(a.value - b.value, 1.0, a, -1.0, b);
  }
  friend Tangent operator*(const Tangent& a, const Tangent& b) {
    return make(a.value * b.value, b.value, a, a.value, b);
  }
  friend Tangent operator/(const Tangent& a, const Tangent& b) {
    const double x = a.value / b.value;
    return make(x, 1.0 / b.value, a, -x / b.value, b);
  }

  friend bool isfinite(const Tangent& a) { return std::isfinite(a.value); }
  friend bool isinf(const Tangent& a) { return std::isinf(a.value); }
  friend bool isnan(const Tangent& a) { return std::isnan(a.value); }
  friend Tangent fabs(const Tangent& a) { return a.value < 0.0 ? -a : a; }
  friend Tangent fmin(const Tangent& a, const Tangent& b) { return b.value < a.value ? b : a; }
  friend double fmax(double a, const Tangent& b) { return std::fmax(a, b.value); }

  // A number as one operand (of itself it would be as near to a double).
#define VARIATOR_SIM_OPERATION(operation)                               \
  template <class T, class = std::enable_if_t<std::is_arithmetic_v<T>>> \
  friend Tangent operator operation(T a, const Tangent& b) {            \
    return Tangent(static_cast<double>(a)) operation b;                 \
  }                                                                     \
  template <class T, class = std::enable_if_t<std::is_arithmetic_v<T>>> \
  friend Tangent operator operation(const Tangent& a, T b) {            \
    return a operation Tangent(static_cast<double>(b));                 \
  }                                                                     \
  template <class T>                                                    \
  Tangent& operator operation##=(const T& b) {                          \
    return *this = *this operation b;                                   \
  }
  VARIATOR_SIM_OPERATION(+)
  VARIATOR_SIM_OPERATION(-)
  VARIATOR_SIM_OPERATION(*)
  VARIATOR_SIM_OPERATION(/)
#undef VARIATOR_SIM_OPERATION
#define VARIATOR_SIM_FUNCTION(name, derivative) \
  friend Tangent name(const Tangent& a) {       \
    const double x = a.value, y = std::name(x); \
    (void)x;                                    \
    return make(y, derivative, a);              \
  }
  VARIATOR_SIM_FUNCTION(exp, y)
  VARIATOR_SIM_FUNCTION(expm1, y + 1.0)
  VARIATOR_SIM_FUNCTION(log, 1.0 / x)
  VARIATOR_SIM_FUNCTION(sqrt, 0.5 / y)
  VARIATOR_SIM_FUNCTION(sin, std::cos(x))
  VARIATOR_SIM_FUNCTION(cos, -std::sin(x))
  VARIATOR_SIM_FUNCTION(tan, 1.0 + y * y)
  VARIATOR_SIM_FUNCTION(sinh, std::cosh(x))
  VARIATOR_SIM_FUNCTION(cosh, std::sinh(x))
  VARIATOR_SIM_FUNCTION(tanh, 1.0 - y * y)
  VARIATOR_SIM_FUNCTION(asin, 1.0 / std::sqrt(1.0 - x * x))
  VARIATOR_SIM_FUNCTION(acos, -1.0 / std::sqrt(1.0 - x * x))
  VARIATOR_SIM_FUNCTION(atan, 1.0 / (1.0 + x * x))
#undef VARIATOR_SIM_FUNCTION
  friend Tangent atan2(const Tangent& a, const Tangent& b) {
    const double square = a.value * a.value + b.value * b.value;
    return make(std::atan2(a.value, b.value), b.value / square, a, -a.value / square, b);
  }
  friend Tangent pow(const Tangent& a, const Tangent& b) {
    const double y = std::pow(a.value, b.value);
    const double by_exponent = b.isConstant() ? 0.0 : y * std::log(a.value);
    return make(y, b.value * std::pow(a.value, b.value - 1.0), a, by_exponent, b);
  }
};

}  // namespace variator_sim
