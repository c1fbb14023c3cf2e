/// The base of all motions: their current time, commands and samples.
///
/// Steps are made freely ahead of the current time; the current time lies in the last one. Samples
/// are taken from inside that step and commands cut it, so that no sampling rate, tick or advance
/// changes one bit of the motion:
///
///     command(input, value):
///       clamp it; it waits with the others of this time
///
///     settle(), before the current time moves and before the state is read there:
///       no command waits?        done
///       before the first advance: commands are initial values; start anew
///       cut the last step at the current time
///       inputs take their new closed forms; those that jump do so together, by the jump map
///       steps begin anew from there
///
///     advanceTo(time):
///       settle
///       for every timeout on the way, then to `time`:
///         while the last step ends before it: one step more, or the end of a sleep
///         the current time moves there
///         a timeout's command acts: settle
///
///     sample():
///       the current state, from inside the last step; everything published from it
///
///     reset():
///       the state at time 0 again, with the inputs as the scene has them
///
///     saveState():
///       settle
///       cut the last step at the current time
///       continue from there, as a motion restored from the state does
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "machine_code/kernel_library.h"
#include "motion/command_queue.h"
#include "motion/error_estimate.h"
#include "motion/quantities.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/sample.h"
#include "variator_sim/simulation.h"
#include "variator_sim/status.h"

namespace variator_sim {

struct Element;

/// The motion of one scene, the steps of which ProgramMotion makes. All are [loop] but
/// construction, states from elsewhere, descriptions and machine code.
struct MotionBase {
  explicit MotionBase(Scene its_scene);
  virtual ~MotionBase() = default;
  MotionBase(const MotionBase&) = delete;
  MotionBase& operator=(const MotionBase&) = delete;
  static const MotionBase& of(const Simulation& simulation) { return *simulation.motion_; }
  static MotionBase& of(Simulation& simulation) { return *simulation.motion_; }

  const MotionStatus& advanceTo(double end);
  /// Carries out commands; nothing else does. All that wait take effect together at the current
  /// time: where inputs jump the torques move on the straight line between their old and new
  /// values, so that no order means anything.
  void settle();
  /// Returns the current state without settling commands.
  Sample& sample();
  /// See Simulation.
  double quietUntil() const;
  bool peekState(MotionState* state);
  OperatingPoint operatingPoint();
  /// Uses the machine code of `other`, if it has some that fits. False if it does not.
  bool useCodeOf(const MotionBase& other);
  void forgetSample() {
    is_sample_valid_ = false;
    quiet_until_ = -1.0;
  }

  virtual const MotionStatus& status() const = 0;
  virtual Statistics& statistics() = 0;
  virtual void reset() = 0;
  virtual bool isSleeping() const = 0;
  /// Returns the time up to which steps are made, s: the current time or later.
  virtual double frontTime() const = 0;
  /// Returns the sample's state as a view; valid until the next evaluation elsewhere.
  virtual StateView view() = 0;
  virtual const CommandSignal& signal(int input) const = 0;
  virtual bool saveState(MotionState* state) = 0;
  virtual std::string setState(const MotionState& state, bool project) = 0;
  virtual void trackEnergy(bool on) = 0;
  virtual bool isEnergyTracked() const = 0;
  virtual Energy calcEnergy() = 0;
  virtual EnergyDoubt energyDoubt() const = 0;
  virtual void exhaustTime() = 0;
  /// See Simulation.
  virtual bool takeModeEvent(ModeEvent* /*event*/) { return false; }

  /// Writes the element that the description names to `culprit`, unless that is null.
  virtual std::string describeStop(Element* culprit) = 0;
  virtual const char* stepperName() const = 0;
  virtual std::string describeStepper() const = 0;
  virtual std::vector<std::string> skips() const = 0;
  /// Loads machine code; returns "" or why there is none.
  virtual std::string loadCode(KernelLibrary::Missing missing, bool* compiled) = 0;
  /// Uses the machine code of `other` if the scenes differ in numbers alone. False if it does not.
  virtual bool shareMachineCode(const MotionBase& other) = 0;

  const Scene scene;
  CommandQueue commands;
  const Quantities quantities;
  std::unique_ptr<ErrorEstimate> error_estimate;  ///< null: errors are not estimated
  std::string machine_code = "the interpreter";   ///< or another sentence
  bool has_machine_code = false;
  double time = 0.0;  ///< the current time

 protected:
  /// Writes the inputs at the current time.
  void writeInputs(MotionState* state) const;
  /// Returns the current time as the inputs' signals count it.
  virtual double signalTime() const = 0;
  virtual bool isStart() const = 0;
  virtual void leaveStart() = 0;
  /// True when the last step, or a sleep, reaches `end`.
  virtual bool isMadeUpTo(double end) const = 0;
  /// Makes one accepted step or ends a sleep. False when the motion stopped.
  virtual bool step(double end) = 0;
  /// Returns the latest time inside the last step.
  virtual double lastInside() const = 0;
  virtual void changeInputs() = 0;
  /// Applies commands before the first advance: a zero-order command is the initial value, no jump,
  /// so the accelerations of least reaction are those with it; the others set targets.
  virtual void changeInitialInputs() = 0;
  virtual void takeSample(Sample* sample) = 0;

 private:
  /// Moves the current time to `end`, or to the time of a stop.
  void moveTo(double end);
  bool isAnyCommandNew() const;

  Sample sample_;
  bool is_sample_valid_ = false;
  double quiet_until_ = -1.0;  // s: up to here nothing but the current time changes
};

}  // namespace variator_sim
