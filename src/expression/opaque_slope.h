/// A first derivative of an opaque function, as a function that has derivatives itself.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "variator_sim/expression/opaque_function.h"

namespace variator_sim::expression {

/// df/dx_by, `by` counted from 1. Its value is f's gradient entry, its gradient central differences
/// of order 4 of this entry:
///     dg/dx = (8 (g(x + h) - g(x - h)) - (g(x + 2h) - g(x - 2h))) / 12h
class OpaqueSlope final : public OpaqueFunction {
 public:
  OpaqueSlope(std::shared_ptr<const OpaqueFunction> of, int by)
      : OpaqueFunction(of->argumentCount()), of_(std::move(of)), by_(by) {}

  bool is(const OpaqueFunction* of, int by) const { return of_.get() == of && by_ == by; }
  /// Returns how many times a function has been differentiated.
  static int countIn(const OpaqueFunction& function) {
    const auto* const slope = dynamic_cast<const OpaqueSlope*>(&function);
    return slope == nullptr ? 0 : 1 + countIn(*slope->of_);
  }

  double value(const double* x) const override {
    double gradient[kMostArguments] = {};
    of_->calcGradient(x, gradient);
    return gradient[by_ - 1];
  }
  void calcGradient(const double* x, double* gradient) const override {
    // Truncation h^4/30 and rounding 1e-16/h are both below 1e-11 if f is smooth over 1/50 of x.
    constexpr double kStep = 1e-4;
    double moved[kMostArguments];
    std::copy_n(x, argumentCount(), moved);
    for (int j = 0; j < argumentCount(); ++j) {
      const double h = kStep * std::max(1.0, std::abs(x[j]));
      const auto difference = [&](double step) {
        moved[j] = x[j] + step;
        const double above = value(moved);
        moved[j] = x[j] - step;
        return above - value(moved);
      };
      gradient[j] = (8.0 * difference(h) - difference(2.0 * h)) / (12.0 * h);
      moved[j] = x[j];
    }
  }

 private:
  std::shared_ptr<const OpaqueFunction> of_;
  int by_;
};

}  // namespace variator_sim::expression
