/// Commands between their coming and their taking effect.
#pragma once

#include <vector>

#include "variator_sim/command_input.h"
#include "variator_sim/types.h"

namespace variator_sim {

/// Those that wait for the present to move, and when inputs are to fall back because none has come.
/// All are [loop].
class CommandQueue {
 public:
  struct Command {
    int input;
    double value;
  };

  /// `inputs` has to outlive this.
  explicit CommandQueue(const std::vector<CommandInputSettings>& inputs);
  void reset();

  /// A command came at `time`, s; true when it is clamped. Of several to one input the last one
  /// counts.
  bool add(int input, double value, double time);
  /// The first command that was clamped, through resets; NaN where none was.
  double firstClamped(int input) const { return first_clamped_[input]; }
  bool isEmpty() const { return count_ == 0; }
  int count() const { return count_; }
  const Command& operator[](int n) const { return commands_[n]; }
  void clear() { count_ = 0; }

  /// When the first input is to fall back, s; infinity when none is.
  double nextTimeout() const;
  /// When the last command to an input came, s; infinity where none has, or it has timed out.
  double lastTime(int input) const { return last_time_[input]; }
  void setLastTime(int input, double time) { last_time_[input] = time; }

  /// Adds what inputs fall back to whose command is overdue at `time`; two that are meant for one
  /// instant may be `rounding` apart. Returns how many.
  int addTimeouts(double time, double rounding);

 private:
  void stage(int input, double value);

  const std::vector<CommandInputSettings>& inputs_;
  Command commands_[kMaxInputs];
  int count_ = 0;
  double last_time_[kMaxInputs];
  double first_clamped_[kMaxInputs];
};

}  // namespace variator_sim
