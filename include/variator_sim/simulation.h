/// The motion of one scene: steps it, takes commands, gives samples. Knows no wall clock.
#pragma once

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

class SeriesLanes;
class StepsTogether;
struct Motion;

enum class CommandResult { kAccepted, kClamped, kRefused };

/// How it is used:
///     simulation.advanceTo(t);          // the present moves to t
///     simulation.command(input, value); // takes effect at the present
///     simulation.sample();              // all columns at the present, after its commands
/// The motion depends on the scene and on the (time, input, value) of the commands only: neither
/// where it is sampled nor how its advances are cut changes one bit of it.
///
/// Methods marked [loop] allocate nothing, lock nothing and do not throw.
class Simulation {
 public:
  /// Time 0 with consistent initial accelerations. Throws SceneError when the scene's initial
  /// values contradict its constraints.
  explicit Simulation(Scene scene);
  /// The same, made faster where `scene` is a copy of that of `like` whose inertias, initial values
  /// or settings were changed: programs are copied, and machine code is shared.
  Simulation(Scene scene, const Simulation& like);
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  const Scene& scene() const;

  /// The present, s. [loop]
  double time() const;

  /// Moves the present to `time` (not before the present: then nothing happens). When the motion
  /// stops on the way, the present stays at the last good state and the status says why; from then
  /// on nothing moves until `reset`. After an Interruption the present is where the motion has come
  /// to, and the next advance goes on from there. [loop]
  const MotionStatus& advanceTo(double time);
  /// Up to this time, s, advances do nothing but move the present: it lies inside a step already
  /// made, and no command is pending or overdue. A caller that does not read the motion can leave
  /// them out. [loop]
  double quietUntil() const;

  /// A command at the present. All commands given at one present take effect when the present is
  /// next sampled or advanced, together: of two to one input the last counts. NaN and infinity are
  /// refused, whatever `input` is, values outside [min, max] clamped; both are counted. A
  /// zero-order command at time 0, before any advance, sets the initial value. [loop]
  CommandResult command(int input, double value);
  /// The first command to this input that was clamped, through resets; NaN where none was. [loop]
  double firstClampedCommand(int input) const;
  /// Stops the motion at its present because its caller can count time no further.
  void exhaustTime();

  /// When the next input goes without a command for its timeout, s; infinity when none will. [loop]
  double nextTimeout() const;

  /// Everything at the present, after its commands. [loop]
  const Sample& sample();

  /// The present, after its commands, for `linearize` (linear_model.h).
  OperatingPoint operatingPoint();

  /// Names of a group's quantities, in the order of their values.
  const std::vector<std::string>& quantityNames(QuantityGroup group) const;
  /// A group's values at the present, after its commands, into `values`, which has room for as many
  /// as there are names. They cost nothing where they are not asked for, and change no bit; a value
  /// that does not exist is NaN. [loop]
  void calcQuantities(QuantityGroup group, double* values);

  /// Whether samples have the energies, and each step's are integrated to about the tolerance of
  /// the motion, which costs about as much as the step again; otherwise they are estimated from its
  /// ends. Holds for later steps, through resets: to be set before the first advance if the whole
  /// motion is to be integrated. Changes no bit of the motion. [loop]
  void trackEnergy(bool on);
  /// The energies at the present, after its commands, tracked or not. [loop]
  Energy energy();
  /// [loop]
  EnergyDoubt energyDoubt() const;

  /// Whether samples have estimates of their own global errors, in angles, velocities and
  /// accelerations, by a second motion of the same scene that is stepped more finely: it costs one
  /// to two times the motion again and changes no bit of it. To be called before the first advance
  /// or after a reset. Not for the real-time loop.
  void estimateErrors(bool on);
  /// Says where the estimates of the samples taken so far were not to be trusted. [loop]
  ErrorDoubt errorDoubt() const;
  /// How errors are estimated: "auto at a relative tolerance of 1e-11"; "" where they are not.
  std::string describeErrorEstimate() const;

  /// [loop]
  const MotionStatus& status() const;
  const Statistics& statistics() const;

  /// Back to time 0 and the initial state; commands and counters are forgotten. [loop]
  void reset();

  /// Writes the state at the present, after its commands; false when the motion has stopped. The
  /// motion goes on from what is written, exactly as one does that is given it by `setState`: with
  /// steps begun anew, so within the tolerance, but not to the bit, as if it had not been saved.
  /// [loop]
  bool saveState(MotionState* state);
  /// The same state without a history, as the sample at the present has it; the motion goes on as
  /// if it had not been read. False when it has stopped. [loop]
  bool peekState(MotionState* state);
  /// The motion goes on from `state`, at its time. One with a history that is consistent is taken
  /// as it is, to the bit; others are polished onto the constraints, and inconsistent ones moved to
  /// the nearest consistent velocities and accelerations when `project`. "" or why not: then the
  /// motion goes on as after `saveState`. Counters count on.
  std::string setState(const MotionState& state, bool project = false);

  /// The status as a sentence: reason, time, C, which constraint, last good state. "" while
  /// running.
  std::string describeStatus() const;

  /// The stepper in use ("taylor"): what `auto` came to.
  const char* stepperName() const;
  /// The same as a sentence with its reasons, e.g. "auto (taylor, the series of this scene; radau
  /// when stability limits its steps)".
  std::string describeStepper() const;
  /// Lists all that the scene does not need and so is not computed, e.g. "derivatives by the
  /// angles".
  std::vector<std::string> skips() const;

  /// Goes over to machine code for the scene's formulas, which changes no bit of the motion: from
  /// the cache, or, when `compile`, by the system's compiler, which takes about a second: one that
  /// takes more than 5 s is given up, unless the scene or the caller (`patiently`) insists on
  /// machine code. An Interruption ends it. True when formulas run as machine code afterwards;
  /// false, and `machineCode` says why, when the interpreter goes on. Not for the real-time loop.
  bool loadMachineCode(bool compile, bool patiently = false);
  /// Goes over to the machine code of `other`, if it has some and the scenes differ in numbers
  /// alone: a small part of what loading costs. True when formulas run as machine code afterwards.
  /// Not for the real-time loop.
  bool shareMachineCode(const Simulation& other);
  /// Makes steps of this motion and of others with the same machine code at once;
  /// nullptr where it has none, or there is none of that kind. Takes a second or two when it has to
  /// be compiled, which it is if `compile` says so. Not for the real-time loop.
  std::shared_ptr<SeriesLanes> loadLanes(bool compile);
  /// Steps are made by `together` where that may be; it has to outlive this. No bit changes.
  void makeStepsWith(StepsTogether* together);
  /// Says what runs the formulas, in a sentence ("machine code, compiled in 0.12 s", "the
  /// interpreter: no compiler (cc) was found").
  const std::string& machineCode() const;
  /// True when formulas run as machine code. [loop]
  bool hasMachineCode() const;

  /// True while the motion is at rest and not stepped: a command wakes it. [loop]
  bool isSleeping() const;

 private:
  friend struct Motion;
  std::unique_ptr<Motion> motion_;
};

}  // namespace variator_sim
