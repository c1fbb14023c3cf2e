#pragma once

#include <string>

#include "variator_sim/component_context.h"
#include "variator_sim/constraints/automatic_constraint.h"
#include "variator_sim/table.h"

namespace variator_sim {

/// A quantity in a constraint that is constant, a function of time, or commanded:
///     ratio: 0.6
///     ratio: {times: [0, 2, 5], values: [0.4, 0.8, 0.6]}          # s; C2, constant beyond the
///     ends ratio: {topic: ratio, hold: second_order_lag, time_constant: 0.3, initial: 0.6}
class TimeValue {
 public:
  /// How often the constraint differentiates the value.
  enum class Need {
    kOnce,  ///< order 2 and 3: every hold will do
    kTwice  ///< order 1: a jump of u or u' would need an impulse, so `second_order_lag` only
  };

  /// The constant `value`.
  explicit TimeValue(double value = 0.0) : value_(value) {}

  /// Reads `key`; every number in it has to lie in `range`, commands beyond are clamped. `slot` is
  /// where the constraint's formula finds a commanded input: call useInput(slot, input()).
  /// Throws SceneError.
  static TimeValue read(ComponentContext& context, const std::string& key, Range range, Need need,
                        int slot);
  /// As above; the constant `default_value` when the key is absent.
  static TimeValue read(ComponentContext& context, const std::string& key, Range range, Need need,
                        int slot, double default_value);

  /// The value at x. [loop]
  template <class T>
  T operator()(const GenericState<T>& x) const {
    switch (form_) {
      case Form::kConstant:
        break;
      case Form::kTable: {
        const double t = realPart(x.time);
        // The third derivative meets only derivatives of t by the state, which are 0.
        return compose(x.time, table_.value(t), table_.slope(t), table_.curvature(t), 0.0);
      }
      case Form::kCommanded:
        return x.input[slot_];
    }
    return T(value_);
  }

  /// The same at a state of the whole scene. [loop]
  double value(const StateView& state) const {
    switch (form_) {
      case Form::kConstant:
        break;
      case Form::kTable:
        return table_.value(state.time);
      case Form::kCommanded:
        return state.input[input_];
    }
    return value_;
  }

  /// Index of the commanded input in the scene; -1 when it is none.
  int input() const { return input_; }
  /// True when it is a function of time; a commanded input is none.
  bool readsTime() const { return form_ == Form::kTable; }
  /// The instants, s, at which its third derivative jumps.
  std::vector<double> instants() const { return table_.points(); }
  /// True when it never changes.
  bool isConstant() const { return form_ == Form::kConstant; }

 private:
  enum class Form { kConstant, kTable, kCommanded };
  Form form_ = Form::kConstant;
  double value_;
  int slot_ = 0;
  int input_ = -1;
  Table table_;
};

}  // namespace variator_sim
