/// Commands between their arrival and their effect.
#pragma once

#include <cmath>
#include <vector>

#include "variator_sim/command_input.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// Commands that wait for the motion to be settled at the current time, and the timeouts of the
/// inputs. All are [loop].
class CommandQueue {
 public:
  /// `inputs` has to outlive this.
  explicit CommandQueue(const std::vector<CommandInputSettings>& inputs);
  void reset();

  /// Adds a command that came at `time`, s; true when it is clamped. The last of several to one
  /// input counts.
  bool add(int input, double value, double time);
  /// Returns the first command that was clamped, through resets; NaN if none was.
  double firstClamped(int input) const { return first_clamped_[input]; }
  bool isEmpty() const { return is_empty_; }
  /// Tell whether a command waits for this input, and its value.
  bool hasCommand(int input) const { return !std::isnan(value_[input]); }
  double value(int input) const { return value_[input]; }
  void clear();

  /// Returns the time of the next timeout of any input, s; infinity if there is none.
  double nextTimeout() const;
  /// Returns the time of the last command to an input, s; infinity: none, or it timed out.
  double lastTime(int input) const { return last_time_[input]; }
  void setLastTime(int input, double time) { last_time_[input] = time; }

  /// Adds the fallback commands of inputs that are overdue at `time`; two that are meant for one
  /// instant may be `rounding` apart. Returns their number.
  int addTimeouts(double time, double rounding);

 private:
  /// Returns the time of the timeout of input i, s.
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
