/// A formula of a scene, written in C++ as on paper.
///
///     const Expression slip = b.velocity - i * a.velocity;
///     scene.constrain(tau * (b.acceleration - i * a.acceleration) + v * tanh(slip / v));
///
/// An Expression is a name for a node of the scene's graph (graph.h): writing one computes nothing
/// but constants. Derivatives, dependences and events follow from it.
#pragma once

#include <stdexcept>

#include "variator_sim/expression/graph.h"

namespace variator_sim {

class Expression {
 public:
  /// Makes a constant.
  Expression(double value = 0.0) : value_(value) {}  // NOLINT(google-explicit-constructor)
  /// Names a node of `graph`, which has to outlive this.
  Expression(expression::Graph& graph, expression::Node node) {
    if (graph.isConstant(node)) {
      value_ = graph.constantValue(node);
    } else {
      graph_ = &graph;
      node_ = node;
    }
  }

  /// Returns this expression's node in `graph`. Throws std::logic_error when it belongs to another
  /// one.
  expression::Node in(expression::Graph& graph) const {
    if (graph_ == nullptr) return graph.constant(value_);
    if (graph_ != &graph) throw std::logic_error("an Expression of another scene");
    return node_;
  }
  /// The graph of the node; null for a constant.
  expression::Graph* graph() const { return graph_; }
  bool isConstant() const { return graph_ == nullptr; }
  /// The value of a constant.
  double value() const { return value_; }

 private:
  expression::Graph* graph_ = nullptr;
  expression::Node node_;
  double value_ = 0.0;
};

/// a < b and the like, for `where`.
struct Comparison {
  Expression left;
  Expression right;
  bool is_strict;  ///< left < right; else left <= right
};

/// Applies an operation to its operands. Operations on constants alone are computed at once.
Expression apply(expression::Operation operation, const Expression& a);
Expression apply(expression::Operation operation, const Expression& a, const Expression& b);

inline Expression operator-(const Expression& a) {
  return apply(expression::Operation::kNegate, a);
}
inline Expression operator+(const Expression& a, const Expression& b) {
  return apply(expression::Operation::kAdd, a, b);
}
inline Expression operator-(const Expression& a, const Expression& b) {
  return apply(expression::Operation::kSubtract, a, b);
}
inline Expression operator*(const Expression& a, const Expression& b) {
  return apply(expression::Operation::kMultiply, a, b);
}
/// Division by a constant multiplies by its reciprocal.
Expression operator/(const Expression& a, const Expression& b);
inline Expression& operator+=(Expression& a, const Expression& b) {
  return a = a + b;
}
inline Expression& operator-=(Expression& a, const Expression& b) {
  return a = a - b;
}

/// The functions of one operand; abs bends and sign jumps: steps end at these events.
#define VARIATOR_SIM_FUNCTION(name, operation)         \
  inline Expression name(const Expression& a) {        \
    return apply(expression::Operation::operation, a); \
  }
VARIATOR_SIM_FUNCTION(sin, kSin)
VARIATOR_SIM_FUNCTION(cos, kCos)
VARIATOR_SIM_FUNCTION(tan, kTan)
VARIATOR_SIM_FUNCTION(asin, kAsin)
VARIATOR_SIM_FUNCTION(acos, kAcos)
VARIATOR_SIM_FUNCTION(atan, kAtan)
VARIATOR_SIM_FUNCTION(sinh, kSinh)
VARIATOR_SIM_FUNCTION(cosh, kCosh)
VARIATOR_SIM_FUNCTION(tanh, kTanh)
VARIATOR_SIM_FUNCTION(exp, kExp)
VARIATOR_SIM_FUNCTION(log, kLog)
VARIATOR_SIM_FUNCTION(sqrt, kSqrt)
VARIATOR_SIM_FUNCTION(abs, kAbs)
VARIATOR_SIM_FUNCTION(sign, kSign)
#undef VARIATOR_SIM_FUNCTION
inline Expression atan2(const Expression& y, const Expression& x) {
  return apply(expression::Operation::kAtan2, y, x);
}
inline Expression pow(const Expression& base, const Expression& exponent) {
  return apply(expression::Operation::kPower, base, exponent);
}
/// Kinks: steps end at these events.
inline Expression min(const Expression& a, const Expression& b) {
  return apply(expression::Operation::kMin, a, b);
}
inline Expression max(const Expression& a, const Expression& b) {
  return apply(expression::Operation::kMax, a, b);
}
inline Expression clamp(const Expression& a, const Expression& low, const Expression& high) {
  return min(max(a, low), high);
}

inline Comparison operator<(const Expression& a, const Expression& b) {
  return {a, b, true};
}
inline Comparison operator<=(const Expression& a, const Expression& b) {
  return {a, b, false};
}
inline Comparison operator>(const Expression& a, const Expression& b) {
  return {b, a, true};
}
inline Comparison operator>=(const Expression& a, const Expression& b) {
  return {b, a, false};
}
/// Returns `yes` if the comparison holds, `no` otherwise: the if(a < b, x, y) of formulas.
Expression where(const Comparison& condition, const Expression& yes, const Expression& no);

}  // namespace variator_sim
