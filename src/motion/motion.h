/// The motion of a scene: its current time, its commands and its samples.
///
/// The integrator runs freely ahead of the current time, by steps of its own choice; the current
/// time lies in its last one. Samples are taken from inside that step and commands cut it, so that
/// no sampling rate, tick or advance changes one bit of the motion:
///
///     command(input, value):
///       clamp it; it waits with the others of this time
///
///     settle(), before the current time moves and before the state is read there:
///       no command waits?        done
///       before the first advance: commands are initial values; start anew
///       make the step again up to the current time
///       inputs take their new closed forms; those that jump do so together, by the jump map
///       the integrator begins anew from there
///
///     advanceTo(time):
///       settle
///       for every timeout on the way, then to `time`:
///         while the integrator's last step ends before it:
///           one step more (integrator.h), or the end of a sleep; account for its energy
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
///       make the step again up to the current time
///       continue from there, as a motion restored from the state does
#pragma once

#include <memory>
#include <string>

#include "dynamics/system.h"
#include "integrate/diagnosis.h"
#include "integrate/integrator.h"
#include "motion/command_queue.h"
#include "motion/energy.h"
#include "motion/error_estimate.h"
#include "motion/quantities.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// The parts of a Simulation, and the advance of its time. All but its construction are [loop].
struct Motion {
  /// `like`: has programs and machine code that may fit, or nullptr.
  explicit Motion(Scene its_scene, const Shortcuts& shortcuts = {}, const Motion* like = nullptr);
  /// For the core and its tests.
  static std::unique_ptr<Motion>& of(Simulation& simulation) { return simulation.motion_; }

  const MotionStatus& status() const { return integrator.status(); }
  /// Returns the series that the integrator steps by; null if the runtime's text does.
  MotionSeries* series() const { return integrator.runtime().exists() ? nullptr : system.series(); }
  /// Returns the current time as nodes count it.
  double presentTime() const { return integrator.origin().relative(time); }
  /// Returns the time up to which steps are made, s: the current time or later.
  double frontTime() const { return integrator.origin().absolute(integrator.stepEnd().time); }
  /// See Simulation.
  double quietUntil() const;

  void reset();
  const MotionStatus& advanceTo(double end);
  /// Carries out commands; nothing else does. All that wait take effect together at the current
  /// time: inputs that jump move on the straight line between their old and new values, so that no
  /// order means anything.
  void settle();
  /// Returns the current state without settling commands.
  Sample& sample();
  /// Returns the same as a view; valid until the next evaluation elsewhere.
  StateView view();
  /// See Simulation.
  bool shareMachineCode(const Motion& other);

  /// Continues from `state`, with the values x and the accelerations `epsilon`, without any history
  /// of this motion.
  const MotionStatus& beginFrom(const MotionState& state, const State& x, const double* epsilon);
  /// Writes the node at the current time: the step end, or the step made again up to there. False
  /// when the motion stopped.
  bool cutStep(StepNode* node);
  void forgetSample() {
    is_sample_valid_ = false;
    quiet_until_ = -1.0;
  }

  const Scene scene;
  System system;
  Drivetrain& drivetrain;  ///< the system's
  Integrator integrator;
  EnergyMeter energy_meter;
  CommandQueue commands;
  const Quantities quantities;
  std::unique_ptr<ErrorEstimate> error_estimate;  ///< null: errors are not estimated
  std::string machine_code = "the interpreter";   ///< or another sentence
  bool has_machine_code = false;
  double time = 0.0;  ///< the current time

 private:
  /// Computes the state at time 0 with the inputs as they are.
  void start();
  const MotionStatus& advance(double end);
  /// Moves the current time to `end`, or to the time of a stop.
  void moveTo(double end);
  /// Makes one accepted step or ends a sleep, and accounts for its energy. False when the motion
  /// stopped.
  bool step(double end);

  bool isAnyCommandNew() const;
  void changeInputs();
  /// Applies commands before the first advance: a zero-order command is the initial value, no jump,
  /// so the accelerations of least reaction are those with it; the others set targets.
  void changeInitialInputs();

  bool isSampleFinite() const;
  void takeSampleOfState();

  Start start_;  // the last start searched for
  State first_;  // at time 0, with the inputs as the scene has them
  bool knows_first_ = false;
  Sample sample_;
  double sampled_at_ = 0.0;  // as nodes count it: the current time, or just behind an event there
  bool is_sample_valid_ = false;
  double quiet_until_ = -1.0;  // s: up to here nothing but the current time changes
};

}  // namespace variator_sim
