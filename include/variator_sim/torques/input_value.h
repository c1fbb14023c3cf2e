#pragma once

#include <string>

#include "variator_sim/component_context.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// A value u of a torque law that a scene gives either as a number or as a commanded input in a
/// dictionary of its own:
///     rack: 0.8
///     rack: {topic: rack, hold: first_order_lag, time_constant: 0.1, initial: 0.3}
class InputValue {
 public:
  /// The constant `value`.
  explicit InputValue(double value = 0.0) : value_(value) {}

  /// Reads `key`. The number, the commands' `min`, `max` and `initial` have to lie in `range`;
  /// commands beyond it are clamped. Throws SceneError.
  static InputValue read(ComponentContext& context, const std::string& key, Range range);
  /// As above; the constant `default_value` when the key is absent.
  static InputValue read(ComponentContext& context, const std::string& key, Range range,
                         double default_value);

  double value(const StateView& state) const { return input_ < 0 ? value_ : state.input[input_]; }
  double rate(const StateView& state) const { return input_ < 0 ? 0.0 : state.input_rate[input_]; }

 private:
  double value_;
  int input_ = -1;  ///< index of the commanded input; -1: constant
};

}  // namespace variator_sim
