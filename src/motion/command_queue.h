/// Commands between their coming and their taking effect.
#pragma once

#include <cmath>
#include <vector>

#include "variator_sim/command_input.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// Those that wait for the present to be settled, and when inputs are to fall back because none has
/// come. All are [loop].
class CommandQueue {
 public:
  /// `inputs` has to outlive this.
  explicit CommandQueue(const std::vector<CommandInputSettings>& inputs);
  void reset();

  /// A command came at `time`, s; true when it is clamped. Of several to one input the last one
  /// counts.
  bool add(int input, double value, double time);
  /// The first command that was clamped, through resets; NaN where none was.
  double firstClamped(int input) const { return first_clamped_[input]; }
  bool isEmpty() const { return is_empty_; }
  /// Whether a command waits for this input, and its value.
  bool hasCommand(int input) const { return !std::isnan(value_[input]); }
  double value(int input) const { return value_[input]; }
  void clear();

  /// When the first input is to fall back, s; infinity when none is.
  double nextTimeout() const;
  /// When the last command to an input came, s; infinity where none has, or it has timed out.
  double lastTime(int input) const { return last_time_[input]; }
  void setLastTime(int input, double time) { last_time_[input] = time; }

  /// Adds what inputs fall back to whose command is overdue at `time`; two that are meant for one
  /// instant may be `rounding` apart. Returns how many.
  int addTimeouts(double time, double rounding);

 private:
  /// When input i is to fall back, s.
  double timeoutOf(int i) const;
  void stage(int input, double value) {
    value_[input] = value;
    is_empty_ = false;
  }

  const std::vector<CommandInputSettings>& inputs_;
  bool is_empty_ = true;
  double value_[kMaxInputs];  // NaN: none waits
  double last_time_[kMaxInputs];
  double first_clamped_[kMaxInputs];
};

}  // namespace variator_sim
