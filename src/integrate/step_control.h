/// Step sizes from error estimates.
#pragma once

#include <algorithm>
#include <cmath>

namespace variator_sim {

/// Chooses the next step from the error norms of this one and the last accepted one: of explicit
/// schemes by a proportional-integral rule (Hairer, Norsett, Wanner: Solving ODE I, IV.2 (2.43c)),
/// which damps the oscillation between accepting and rejecting where stability, not accuracy,
/// limits the step. Of implicit ones stability limits none.
class StepControl {
 public:
  /// `order` p: the error estimate is of order h^p.
  explicit StepControl(int order) : order_(order) {}
  /// Another estimate's order, and whether stability may limit the steps.
  void setScheme(int order, bool is_explicit) {
    order_ = order;
    beta_ = is_explicit ? 0.04 : 0.0;
  }

  void reset() { previous_norm_ = 1e-4; }
  /// Factor for the step after one with error `norm` <= 1.
  double growth(double norm) {
    const double factor = growthBy(norm);
    previous_norm_ = std::max(norm, 1e-4);
    return factor;
  }
  /// Returns the growth for another norm, and changes nothing.
  double growthBy(double norm) const {
    const double alpha = 1.0 / order_ - 0.75 * beta_;
    norm = std::max(norm, 1e-10);
    // No step needs to be known to more than seven digits.
    const float exponent =
        static_cast<float>(beta_) * std::log2(static_cast<float>(previous_norm_)) -
        static_cast<float>(alpha) * std::log2(static_cast<float>(norm));
    const double factor = kSafety * static_cast<double>(std::exp2(exponent));
    return std::min(kMaxGrowth, std::max(kMaxShrink, factor));
  }
  /// Factor for a new try after one with error `norm` > 1 or NaN.
  double shrink(double norm) const {
    if (!std::isfinite(norm)) return kBlindShrink;
    return std::max(kMaxShrink, std::min(0.9, kSafety * std::pow(norm, -1.0 / order_)));
  }

 private:
  static constexpr double kSafety = 0.9;
  static constexpr double kMaxGrowth = 5.0;
  static constexpr double kMaxShrink = 0.2;
  static constexpr double kBlindShrink = 0.25;  // nothing is known but that the step was too long
  int order_;
  double beta_ = 0.04;
  double previous_norm_ = 1e-4;
};

}  // namespace variator_sim
