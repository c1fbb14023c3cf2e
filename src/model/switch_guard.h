/// The switches of laws in C++ as guards.
#pragma once

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "variator_sim/guard.h"

namespace variator_sim {

/// One switch of a law: nothing is known of it but its value at single states.
class SwitchGuard final : public Guard {
 public:
  /// Writes the values of all switches of the law.
  using Evaluate = std::function<void(const StateView& state, double* values)>;

  /// The one of `index` among `count`. The law behind `evaluate` has to outlive this.
  SwitchGuard(Evaluate evaluate, int count, int index, bool jumps)
      : Guard(jumps),
        evaluate_(std::move(evaluate)),
        index_(static_cast<std::size_t>(index)),
        values_(static_cast<std::size_t>(count)) {}

  int branch(const StateView& state) const override {
    const double value = distance(state);
    return value > 0.0 ? 1 : (value < 0.0 ? -1 : kOnEdge);
  }
  bool mayLeave(const StateBox& /*box*/, int /*branch*/) const override { return true; }
  bool isOpaque() const override { return true; }
  double distance(const StateView& state) const override {
    evaluate_(state, values_.data());
    return values_[index_];
  }

 private:
  Evaluate evaluate_;
  std::size_t index_;
  mutable std::vector<double> values_;
};

/// Adds the guards of `count` switches; `jumps(index)`: whether the law itself jumps at one.
template <class Jumps>
void addSwitchGuards(int count, const SwitchGuard::Evaluate& evaluate, Jumps jumps,
                     std::vector<GuardPtr>& guards) {
  for (int i = 0; i < count; ++i) {
    guards.push_back(std::make_shared<SwitchGuard>(evaluate, count, i, jumps(i)));
  }
}

}  // namespace variator_sim
