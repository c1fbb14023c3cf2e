/// The motion of a scene: the present, its commands and its samples.
///
/// The integrator runs freely ahead of the present, by steps of its own choice; the present lies in
/// its last one. Samples are taken from inside that step and commands cut it, so that nobody's
/// sampling rate, tick or advance changes one bit of the motion:
///
///     advanceTo(time):
///       carry out the commands that wait
///       for every timeout on the way, then to `time`:
///         while the integrator's last step ends before it:
///           one step more (integrator.h), or the end of a rest; account for its energy
///         the present moves there
///
///     command(input, value):
///       clamp it; it waits with the others of this present
///
///     carry out the commands that wait (before the next advance or sample):
///       before the first advance: they are initial values; start anew
///       make the step again up to the present
///       inputs take their new closed forms; those that jump do so together, by the jump map
///       the integrator begins anew from there
///
///     sample():
///       carry out the commands that wait
///       the state at the present, from inside the last step; everything published from it
///
///     reset():
///       the state at time 0 again, with the inputs as the scene has them
///
///     saveState():
///       carry out the commands that wait
///       make the step again up to the present
///       go on from what is saved, as who restores it will
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/principle_system.h"
#include "integrate/diagnosis.h"
#include "integrate/integrator.h"
#include "motion/command_queue.h"
#include "motion/energy.h"
#include "motion/quantities.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// See Simulation for what each public method promises.
class Motion {
 public:
  /// `like`: has programs and machine code that may fit, or nullptr.
  explicit Motion(Scene scene, const Shortcuts& shortcuts = {}, const Motion* like = nullptr);

  const Scene& scene() const { return scene_; }
  double time() const { return time_; }
  const MotionStatus& status() const { return integrator_.status(); }
  const Statistics& statistics();
  const char* stepperName() const { return integrator_.choice().stepper().name(); }
  std::string describeStepper() const { return integrator_.choice().describe(); }
  std::vector<std::string> skips() const;
  bool isSleeping() const { return integrator_.isSleeping(); }
  bool loadMachineCode(bool compile);
  bool shareMachineCode(const Motion& other);
  std::shared_ptr<SeriesLanes> loadLanes(bool compile);
  void makeStepsWith(StepsTogether* together) {
    if (system_.series() != nullptr) system_.series()->makeStepsWith(together);
  }
  const std::string& machineCode() const { return machine_code_; }
  bool hasMachineCode() const { return has_machine_code_; }

  void reset();
  const MotionStatus& advanceTo(double time);
  void interruptBy(const Interruption& interruption) { integrator_.interruptBy(interruption); }
  const Interruption& interruption() const { return integrator_.interruption(); }
  double quietUntil() const;
  double nextTimeout() const { return commands_.nextTimeout(); }
  /// Up to where it has been stepped, s: as far as the present or further.
  double frontTime() const { return integrator_.origin().absolute(integrator_.front().time); }
  CommandResult command(int input, double value);
  void exhaustTime() { integrator_.exhaustTime(time_); }
  void refuseCommand() { ++integrator_.statistics().commands_refused; }
  const Sample& sample();
  OperatingPoint operatingPoint();
  const Quantities& quantities() const { return quantities_; }
  void calcQuantities(QuantityGroup group, double* values);

  bool peekState(MotionState* state);
  bool saveState(MotionState* state);
  std::string setState(const MotionState& state, bool project);

  void trackEnergy(bool on);
  Energy energy();
  EnergyDoubt energyDoubt() const;

  /// Row m of C at the present, s values; for messages.
  void calcConstraintRow(int m, double* C);

 private:
  /// Whether code that is not in the cache is compiled: who asks for it waits for a busy compiler.
  KernelLibrary::Missing missingCode(bool compile) const;
  /// The present as nodes count it.
  double present() const { return integrator_.origin().relative(time_); }
  /// The present as `state` tells it, but for a history.
  void noteState(const double* angle, const double* velocity, const double* acceleration,
                 MotionState* state);
  /// True when the present lies within the last step, and not at its end.
  bool isInsideStep() const;

  /// The state at time 0 with the inputs as they are.
  void start();
  const MotionStatus& advance(double time);
  /// Brings the present to `time`, or to where the motion stops.
  void moveTo(double time);

  /// All commands that wait take effect at the present, together: inputs that jump move on the
  /// straight line between their old and new values, so that no order means anything.
  void carryOutCommands();
  void changeInputs(const CommandQueue& queue);
  /// Those before the first advance: a zero-order one is the initial value, no jump, so the
  /// accelerations of least reaction are those with it; the others set targets.
  void carryOutInitialCommands();
  bool isAnyCommandNew() const;

  bool isSampleFinite() const;
  void forgetSample() {
    sample_valid_ = false;
    quiet_until_ = -1.0;
  }
  void takeSample();
  void takeSampleOfState();

  /// The motion goes on from `state`, with the accelerations `epsilon` and nothing else that this
  /// one has had before.
  const MotionStatus& beginFrom(const MotionState& state, const State& x, const double* epsilon);

  /// The motion goes on from `node`, inside the last step or at rest.
  void cutEnergy(const StepNode& node);
  /// The applied energy at the present, J.
  double calcApplied();

  Scene scene_;
  std::unique_ptr<PrincipleSystem> own_system_;
  PrincipleSystem& system_;
  Drivetrain& drivetrain_;  // the system's
  Integrator integrator_;
  EnergyMeter energy_;
  CommandQueue commands_;
  Quantities quantities_;
  Start start_;  // the last one looked for
  State first_;  // at time 0, with the inputs as the scene has them
  bool knows_first_ = false;
  std::string machine_code_ = "the interpreter";
  bool has_machine_code_ = false;
  double time_ = 0.0;  // the present
  Sample sample_;
  bool sample_valid_ = false;
  double quiet_until_ = -1.0;  ///< s: nothing but the present changes as far as there
};

}  // namespace variator_sim
