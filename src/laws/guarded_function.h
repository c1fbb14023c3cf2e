/// The boundary of the package to opaque functions of others.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "model/thrown.h"
#include "variator_sim/expression/opaque_function.h"

namespace variator_sim {

/// A function of a plugin, which throws nothing any more: where it threw, it has no value (NaN),
/// and what it threw is kept for the message of the stop. Keeps the plugin's code loaded.
class GuardedFunction final : public OpaqueFunction {
 public:
  GuardedFunction(std::shared_ptr<const OpaqueFunction> function,
                  std::shared_ptr<const void> libraries)
      : OpaqueFunction(function->argumentCount()),
        libraries_(std::move(libraries)),
        function_(std::move(function)) {}

  bool isOf(const OpaqueFunction* function) const { return function_.get() == function; }

  double value(const double* x) const override {
    try {
      return function_->value(x);
    } catch (...) {
      keepThrown();
      return kNaN;
    }
  }
  void calcGradient(const double* x, double* gradient) const override {
    try {
      function_->calcGradient(x, gradient);
    } catch (...) {
      keepThrown();
      std::fill_n(gradient, argumentCount(), kNaN);
    }
  }

  /// Describes what it threw last; "" when it has thrown nothing.
  std::string thrown() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return thrown_;
  }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  void keepThrown() const {
    std::string text = describeThrown();
    const std::lock_guard<std::mutex> lock(mutex_);
    thrown_ = std::move(text);
  }

  // The function goes before its code.
  std::shared_ptr<const void> libraries_;
  std::shared_ptr<const OpaqueFunction> function_;
  mutable std::mutex mutex_;
  mutable std::string thrown_;
};

}  // namespace variator_sim
