/// Steps by the text of src/runtime, which has events, moving inputs and tables in it.
#pragma once

#include <memory>

#include "dynamics/scene_program.h"
#include "integrate/current_step.h"
#include "integrate/step_size.h"
#include "motion_program/motion_steps.h"

namespace variator_sim {

/// The integrator keeps the state, the runtime what the next step begins with: it takes over the
/// state where the integrator has changed it. A step that it cannot make is made the other way
/// (TrialSteps). All are [loop] unless they say otherwise.
class RuntimeSteps : private StepPart {
 public:
  RuntimeSteps(CurrentStep& step, StepSize& size) : StepPart(step), size_(size) {}

  /// For a scene whose formulas have series; without effect for others. Not [loop].
  void prepare(const Scene& scene);
  bool exists() const { return program_ != nullptr; }

  /// Returns the code of the steps, whose use makes them by it; empty if there are none. Not
  /// [loop].
  MoreCode machineCode();
  /// Uses the code of `other` if its scene differs in numbers alone; false if it does not. Not
  /// [loop].
  bool share(const RuntimeSteps& other);

  /// Makes the step. False: it is to be made the other way, and `needsRestart` tells whether the
  /// laws' branches at its start are unknown.
  bool make();
  bool needsRestart() const { return has_crossed_; }
  void forget() { is_entered_ = has_crossed_ = false; }

  /// True if the last step is one of these.
  bool made() const { return is_entered_ && end_.time == at_; }
  /// True if the last step has crossed an event before `time` at which a law jumps: its end stands
  /// for the state there.
  bool isBeyondEvent(double time) const {
    return made() && it_.is_event != 0 && time - start_.time >= it_.event;
  }
  /// x at `time` of the last step, not projected.
  void interpolate(double time, State& x) const;
  /// The work, J, of the applied torques over the first `theta` of the last step.
  double calcWork(double theta) const;
  /// See Stepper::stiffness.
  double stiffness() const;

 private:
  /// Steps between two beginnings: there code that was loaded meanwhile takes over, so that no bit
  /// depends on when it was.
  static constexpr int kMostBetween = 64;

  /// Writes the start of the step for MotionSteps::takeOver.
  void describeStart();
  void enter();
  void refuse(scene_status status);
  /// Takes the end of the step that was made. False when it is no good.
  bool takeEnd(double left);
  /// Uses the library if its first step is that of the interpreter. False otherwise.
  bool use(const std::shared_ptr<KernelLibrary>& library);

  StepSize& size_;
  std::unique_ptr<MotionProgram> program_;  ///< null: the scene has none
  std::unique_ptr<MotionSteps> steps_;
  std::unique_ptr<MotionSteps> next_steps_;  ///< of machine code; the interpreter, once in use
  bool takes_next_ = false;                  ///< they take over at the next beginning
  std::shared_ptr<KernelLibrary> library_;   ///< of machine code, or null
  vs_exchange it_ = {};                      ///< its arrays are those below
  double state_[3 * kMaxShafts] = {};
  double multiplier_[kMaxRows] = {};
  double reaction_[kMaxShafts] = {};
  double jerk_[kMaxShafts] = {};
  double torque_[kMaxShafts] = {};
  double torque_rate_[kMaxShafts] = {};
  double entry_[kMaxRows * kMaxShafts] = {};
  double length_[kMaxRows] = {};
  vs_exchanged_signal signal_[kMaxInputs] = {};
  bool is_entered_ = false;
  bool has_crossed_ = false;  ///< an event: the guards' sides of the integrator are old
  int made_since_ = 0;        ///< steps, since the last beginning
  double at_ = 0.0;           ///< the end of the last step
  double refused_at_ = -1.0;  ///< the start of a step that was not made
};

}  // namespace variator_sim
