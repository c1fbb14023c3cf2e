/// The inputs of a motion: their closed forms in force, the commands that wait, and timeouts.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "motion/command_rhythm.h"
#include "motion_program/motion_steps.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// Differences from `time` that are no more than this no longer change it reliably. [loop]
inline double resolutionOf(double time) {
  return 4.0 * std::numeric_limits<double>::epsilon() * std::abs(time);
}

/// All are [loop].
class MotionInputs {
 public:
  /// `scene` has to outlive this.
  explicit MotionInputs(const Scene& scene);

  /// Returns to the inputs as the scene has them, at `time`, s.
  void reset(double time);
  /// Copies the inputs at `time`, s, into a state, and back from its own time.
  void save(double time, MotionState* state) const;
  void restore(const MotionState& state);

  const CommandSignal& signal(int i) const { return signal_[i]; }
  /// Returns u and its rates at `time`, s, by the closed forms in force.
  CommandSignal::Moment at(int i, double time) const;
  /// Writes the closed forms, since the last change.
  void describe(vs_exchanged_signal* to) const;

  /// Adds a command that came at `time`, s, and waits for the motion to be settled there; true when
  /// it is clamped. The last of several to one input counts.
  bool command(int i, double value, double time);
  /// Returns the first command that was clamped, through resets; NaN if none was.
  double firstClamped(int i) const { return first_clamped_[i]; }
  /// True when a command waits, and when one that does changes an input.
  bool isAnyWaiting() const { return is_any_waiting_; }
  bool isAnyNew() const;
  /// Forgets the commands that wait.
  void clear();

  /// Returns the time of the next timeout of any input, s; infinity if there is none.
  double nextTimeout() const;
  /// Adds the fallback commands of inputs that are overdue at `time`, s. Returns their number.
  int addTimeouts(double time);
  /// Returns the time when the next command may be expected, s; infinity for none.
  double nextExpected() const { return rhythm_.next(); }

  /// Waiting commands before the first advance: a zero-order command is the initial value, no jump,
  /// so the accelerations of least reaction are those with it; the others set targets.
  void begin();
  /// The inputs take new closed forms at `time`, s, by the commands that wait. Returns true when
  /// one of them jumps.
  bool change(double time);
  /// Takes over the values at `time`, s, of states and variables from the program.
  void takeMemory(double time, const vs_exchanged_signal* from);

 private:
  int count() const { return static_cast<int>(settings_.size()); }
  const CommandInputSettings& settings(int i) const {
    return settings_[static_cast<std::size_t>(i)];
  }
  bool isWaiting(int i) const { return !std::isnan(waiting_[i]); }
  /// Returns the command as it is taken, which waits now.
  double wait(int i, double value);
  /// Returns the time of the timeout of input i, s.
  double timeoutOf(int i) const;

  const std::vector<CommandInputSettings>& settings_;
  CommandRhythm rhythm_;
  double origin_ = 0.0;  ///< s, that the signals' times count from
  CommandSignal signal_[kMaxInputs];
  bool is_any_waiting_ = false;
  double waiting_[kMaxInputs];    ///< NaN: none
  double last_time_[kMaxInputs];  ///< s, of the last command; infinity: none, or it timed out
  double first_clamped_[kMaxInputs];
};

}  // namespace variator_sim
