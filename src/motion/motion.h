/// The motion of a scene: the present, its commands and its samples.
///
/// The integrator runs freely ahead of the present, by steps of its own choice; the present lies in
/// its last one. Samples are taken from inside that step and commands cut it, so that no sampling
/// rate, tick or advance changes one bit of the motion:
///
///     command(input, value):
///       clamp it; it waits with the others of this present
///
///     settle(), before the present moves and before anything is read there:
///       no command waits?        done
///       before the first advance: commands are initial values; start anew
///       make the step again up to the present
///       inputs take their new closed forms; those that jump do so together, by the jump map
///       the integrator begins anew from there
///
///     advanceTo(time):
///       settle
///       for every timeout on the way, then to `time`:
///         while the integrator's last step ends before it:
///           one step more (integrator.h), or the end of a rest; account for its energy
///         the present moves there
///         a timeout's command acts: settle
///
///     sample():
///       the state at the present, from inside the last step; everything published from it
///
///     reset():
///       the state at time 0 again, with the inputs as the scene has them
///
///     saveState():
///       settle
///       make the step again up to the present
///       go on from there, as a motion does that the state is restored to
#pragma once

#include <memory>
#include <string>

#include "dynamics/principle_system.h"
#include "integrate/diagnosis.h"
#include "integrate/integrator.h"
#include "motion/command_queue.h"
#include "motion/energy.h"
#include "motion/error_estimate.h"
#include "motion/quantities.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// The parts of a Simulation, and how its present moves. All but its construction are [loop].
struct Motion {
  /// `like`: has programs and machine code that may fit, or nullptr.
  explicit Motion(Scene its_scene, const Shortcuts& shortcuts = {}, const Motion* like = nullptr);
  /// For the core and its tests.
  static std::unique_ptr<Motion>& of(Simulation& simulation) { return simulation.motion_; }

  const MotionStatus& status() const { return integrator.status(); }
  /// The present as nodes count it.
  double presentTime() const { return integrator.origin().relative(time); }
  /// Up to where it has been stepped, s: as far as the present or further.
  double frontTime() const { return integrator.origin().absolute(integrator.front().time); }
  /// See Simulation.
  double quietUntil() const;

  void reset();
  const MotionStatus& advanceTo(double end);
  /// The only place where commands are carried out. All that wait take effect at the present,
  /// together: inputs that jump move on the straight line between their old and new values, so that
  /// no order means anything.
  void settle();
  /// The state at the present, as it is.
  Sample& sample();
  /// The same as a view; valid until anything is evaluated elsewhere.
  StateView view();
  /// See Simulation.
  bool shareMachineCode(const Motion& other);

  /// The motion goes on from `state`, with the values x and the accelerations `epsilon`, and
  /// nothing else that this one has had before.
  const MotionStatus& beginFrom(const MotionState& state, const State& x, const double* epsilon);
  /// The node at the present: the front, or the step made again up to there. False when the motion
  /// stopped.
  bool cutStep(StepNode* node);
  void forgetSample() {
    is_sample_valid_ = false;
    quiet_until_ = -1.0;
  }

  const Scene scene;
  const std::unique_ptr<PrincipleSystem> own_system;
  PrincipleSystem& system;
  Drivetrain& drivetrain;  ///< the system's
  Integrator integrator;
  EnergyMeter energy_meter;
  CommandQueue commands;
  const Quantities quantities;
  std::unique_ptr<ErrorEstimate> error_estimate;  ///< none: errors are not estimated
  std::string machine_code = "the interpreter";   ///< or another sentence
  bool has_machine_code = false;
  double time = 0.0;  ///< the present

 private:
  /// The state at time 0 with the inputs as they are.
  void start();
  const MotionStatus& advance(double end);
  /// Brings the present to `end`, or to where the motion stops.
  void moveTo(double end);
  /// One accepted step, or the end of a rest; account for its energy. False when the motion
  /// stopped.
  bool step(double end);

  bool isAnyCommandNew() const;
  void changeInputs();
  /// Before the first advance: a zero-order command is the initial value, no jump, so the
  /// accelerations of least reaction are those with it; the others set targets.
  void changeInitialInputs();

  bool isSampleFinite() const;
  void takeSampleOfState();

  Start start_;  // the last one looked for
  State first_;  // at time 0, with the inputs as the scene has them
  bool knows_first_ = false;
  Sample sample_;
  double sampled_at_ = 0.0;  // as nodes count it: the present, or just behind an edge there
  bool is_sample_valid_ = false;
  double quiet_until_ = -1.0;  // s: nothing but the present changes as far as there
};

}  // namespace variator_sim
