/// The inputs of a motion: commands that wait, and the closed forms that its program reads.
#pragma once

#include "motion/command_queue.h"
#include "motion/command_rhythm.h"
#include "motion_program/motion_steps.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/scene.h"

namespace variator_sim {

/// All are [loop].
class MotionInputs {
 public:
  /// `scene` has to outlive this.
  explicit MotionInputs(const Scene& scene) : commands(scene.inputs), settings_(scene.inputs) {}

  CommandQueue commands;

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

  /// True when a command that waits changes an input.
  bool isAnyNew() const;
  /// Waiting commands before the first advance: a zero-order command is the initial value, no jump,
  /// so the accelerations of least reaction are those with it; the others set targets.
  void begin();
  /// The inputs take new closed forms at `time`, s, by the commands that wait. Returns true when
  /// one of them jumps.
  bool change(double time);
  /// Takes over the values at `time`, s, of states and variables from the program.
  void takeMemory(double time, const vs_exchanged_signal* from);
  /// Returns the time when the next command may be expected, s; infinity for none.
  double nextExpected() const { return rhythm_.next(); }

 private:
  int count() const { return static_cast<int>(settings_.size()); }
  const CommandInputSettings& settings(int i) const {
    return settings_[static_cast<std::size_t>(i)];
  }

  const std::vector<CommandInputSettings>& settings_;
  CommandRhythm rhythm_;
  double origin_ = 0.0;  ///< s, that the signals' times count from
  CommandSignal signal_[kMaxInputs];
};

}  // namespace variator_sim
