/// The motion of one scene: advances, takes commands, returns samples. Independent of wall time.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "variator_sim/motion_state.h"
#include "variator_sim/operating_point.h"
#include "variator_sim/quantity_group.h"
#include "variator_sim/sample.h"
#include "variator_sim/scene.h"
#include "variator_sim/status.h"

namespace variator_sim {

struct Motion;

enum class CommandResult { kAccepted, kClamped, kRefused };

/// Usage:
///     simulation.advanceTo(t);          // moves the current time to t
///     simulation.command(input, value); // takes effect at the current time
///     simulation.sample();              // all columns at the current time, after its commands
/// The motion depends on the scene and on the (time, input, value) of the commands only: neither
/// sample times nor the division into advances change one bit of it.
///
/// Methods marked [loop] allocate nothing, lock nothing and do not throw.
class Simulation {
 public:
  /// Starts at time 0 with consistent initial accelerations. Throws SceneError when the scene's
  /// initial values contradict its constraints.
  explicit Simulation(Scene scene);
  /// Starts faster if `scene` is a copy of that of `like` with changed inertias, initial values or
  /// settings: programs are copied, and machine code is shared.
  Simulation(Scene scene, const Simulation& like);
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  const Scene& scene() const;

  /// Returns the current time, s. [loop]
  double time() const;

  /// Moves the current time to `time`; does nothing for an earlier time. When the motion stops on
  /// the way, the time stays at the last accepted state and the status says why; from then on
  /// nothing moves until `reset`. After an Interruption the time is the one reached, and the next
  /// advance continues from there. [loop]
  const MotionStatus& advanceTo(double time);
  /// Returns the time, s, up to which advances only move the current time: it lies inside a step
  /// already made, and no command is pending or overdue. A caller that does not read the motion can
  /// leave them out. [loop]
  double quietUntil() const;

  /// Takes a command at the current time. All commands of one time take effect together when the
  /// motion is next sampled or advanced: the last one to an input counts. NaN and infinity are
  /// rejected for any `input`, values outside [min, max] clamped; both are counted. A zero-order
  /// command at time 0, before any advance, sets the initial value. [loop]
  CommandResult command(int input, double value);
  /// Returns the first clamped command to this input, through resets; NaN if none. [loop]
  double firstClampedCommand(int input) const;
  /// Stops the motion because its caller cannot represent later times.
  void exhaustTime();
  /// Takes the oldest change of a mode, or event of the scene, up to the current time that has not
  /// been taken, of the last 1024; false if there is none. [loop]
  bool takeModeEvent(ModeEvent* event);
  /// From now on all of them wait to be taken, for which advances allocate.
  void keepModeEvents();
  /// Returns the number of those that were forgotten before they were taken. [loop]
  std::uint64_t lostModeEvents() const;

  /// Returns the time, s, of the next command timeout of any input; infinity if none. [loop]
  double nextTimeout() const;

  /// Returns everything at the current time, after its commands. [loop]
  const Sample& sample();

  /// Returns the current state, after its commands, for `linearize` (linear_model.h).
  OperatingPoint operatingPoint();

  /// Returns the names of a group's quantities, in the order of their values.
  const std::vector<std::string>& quantityNames(QuantityGroup group) const;
  /// Writes a group's values at the current time, after its commands, one for each name. They cost
  /// nothing unless requested, and change no bit; a value that does not exist is NaN. [loop]
  void calcQuantities(QuantityGroup group, double* values);

  /// Puts energies into samples or not. If on, those of each step are integrated to about the
  /// tolerance of the motion, which costs about as much as the step again; otherwise they are
  /// estimated from its ends. Holds for later steps, through resets: set it before the first
  /// advance to integrate the whole motion. Changes no bit of the motion. [loop]
  void trackEnergy(bool on);
  /// Returns the energies at the current time, after its commands, tracked or not. [loop]
  Energy energy();
  /// Returns the doubt about the reactions as a source or sink of energy. [loop]
  EnergyDoubt energyDoubt() const;

  /// Puts estimates of the global errors in angles, velocities and accelerations into samples or
  /// not. A second motion of the same scene is stepped more finely: it costs one to two times the
  /// motion again and changes no bit of it. Call before the first advance or after a reset; not in
  /// the real-time loop.
  void estimateErrors(bool on);
  /// Returns where the estimates of the samples so far are unreliable. [loop]
  ErrorDoubt errorDoubt() const;
  /// Describes the estimate: "auto at a relative tolerance of 1e-11"; "" if there is none.
  std::string describeErrorEstimate() const;

  /// Returns why the motion has stopped, if it has. [loop]
  const MotionStatus& status() const;
  const Statistics& statistics() const;

  /// Returns to time 0 and the initial state; forgets commands and counters. [loop]
  void reset();

  /// Writes the current state, after its commands; false when the motion has stopped. The motion
  /// continues exactly as one that `setState` gives this state: its steps restart, so it agrees
  /// with the motion that was not saved within the tolerance, not to the bit. [loop]
  bool saveState(MotionState* state);
  /// Writes the same state without a history, as the current sample has it; the motion is not
  /// affected. False when it has stopped. [loop]
  bool peekState(MotionState* state);
  /// Continues the motion from `state`, at its time. A consistent state with a history is taken as
  /// it is, to the bit; others are polished onto the constraints, and inconsistent ones moved to
  /// consistent velocities and accelerations near them when `project`. Returns "" or the reason
  /// for a failure: the motion then continues as after `saveState`. Counters count on.
  std::string setState(const MotionState& state, bool project = false);

  /// Returns the status as a sentence: reason, time, C, which constraint, last accepted state. ""
  /// while running.
  std::string describeStatus() const;

  /// Returns the stepper in use ("taylor"), which `auto` may have chosen.
  const char* stepperName() const;
  /// Returns the same as a sentence with its reasons, e.g. "auto (taylor, the series of this scene;
  /// radau when stability limits its steps)".
  std::string describeStepper() const;
  /// Lists the quantities that the scene does not need and the solver skips, e.g. "derivatives by
  /// the angles".
  std::vector<std::string> skips() const;

  /// Switches to machine code for the scene's formulas, which changes no bit of the motion: from
  /// the cache, or, when `compile`, by the system's compiler, which takes about a second: one that
  /// takes more than 5 s is given up, unless the scene or the caller (`patiently`) insists on
  /// machine code. An Interruption ends it. True when formulas run as machine code afterwards; if
  /// false, `machineCode` says why. Not for the real-time loop.
  bool loadMachineCode(bool compile, bool patiently = false);
  /// Switches to the machine code of `other`, if it has some and the scenes differ in numbers
  /// alone: a small part of the cost of loading. True when formulas run as machine code afterwards.
  /// Not for the real-time loop.
  bool shareMachineCode(const Simulation& other);
  /// Says in a sentence how formulas run ("machine code, compiled in 0.12 s", "the interpreter: no
  /// compiler (cc) was found").
  const std::string& machineCode() const;
  /// True when formulas run as machine code. [loop]
  bool hasMachineCode() const;

  /// True while the motion is asleep at an equilibrium: a command wakes it. [loop]
  bool isSleeping() const;

 private:
  friend struct Motion;
  std::unique_ptr<Motion> motion_;
};

}  // namespace variator_sim
