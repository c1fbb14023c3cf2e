/// Opaque functions that formulas call: for example a measured map in the user's code.
#pragma once

#include <stdexcept>

namespace variator_sim {

/// f(x_1, .., x_n), n from 1 to 4, by its values and its first derivatives.
///
/// f has to be continuously differentiable and a function of its arguments alone. Its second
/// derivatives, where formulas need them, are central differences of the gradient; a constraint of
/// order 1, whose motion would depend on them, cannot contain it. At load the gradient is compared
/// with the values, through the laws that call f. Both methods are [loop]: they allocate nothing,
/// take no lock and do not throw; a value that does not exist is NaN.
class OpaqueFunction {
 public:
  static constexpr int kMostArguments = 4;

  explicit OpaqueFunction(int argument_count) : argument_count_(argument_count) {
    if (argument_count < 1 || argument_count > kMostArguments) {
      throw std::invalid_argument("an opaque function has 1 to 4 arguments");
    }
  }
  virtual ~OpaqueFunction() = default;

  int argumentCount() const { return argument_count_; }
  /// Returns f at x, argumentCount() numbers.
  virtual double value(const double* x) const = 0;
  /// Writes df/dx_i, argumentCount() numbers; entries that are 0 may be omitted.
  virtual void calcGradient(const double* x, double* gradient) const = 0;

 private:
  int argument_count_;
};

}  // namespace variator_sim
