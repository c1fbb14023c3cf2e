/// Steps a motion freely, from the start of each step (t_n) to its end (t_{n+1}), in three beats:
///
///     before:   do inputs' closed forms end here? jump where they jump, and begin anew
///               at rest? an event due here? another stepper?
///     attempt:  until one is accepted:
///                 step      at most to the end of reach               (Stepper::step)
///                 project   the end onto the constraints              (StepChecks)
///                 judge     the estimate, the move, what no stage has seen    (StepChecks)
///                 locate    events inside: the step is to end before the first one (EventHandler)
///                 shorter   by the worst of these, or to where an event is
///     after:    the next length, another stepper (StepperChoice)
///
/// Steps of fixed size go through the same loop: theirs is accepted when it exists. Over an event
/// the motion is a series (EventCrossing), which answers for the present as a step does.
///
/// Times inside (of nodes, of inputs' closed forms) are counted from the last beginning.
#pragma once

#include "integrate/event_crossing.h"
#include "integrate/event_handler.h"
#include "integrate/guard_search.h"
#include "integrate/inside_step.h"
#include "integrate/step_size.h"
#include "integrate/trial_steps.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// All are [loop].
class Integrator {
 public:
  /// Both have to outlive this.
  Integrator(System& system, const Scene& scene);

  /// The ends of the last step.
  const StepNode& stepStart() const { return step_.start; }
  const StepNode& stepEnd() const { return step_.end; }
  const TimeOrigin& origin() const { return step_.origin; }
  /// C at the end of the last step.
  const RowWatch::Row* rows() const { return step_.rows.rows(); }
  const StepperChoice& choice() const { return step_.choice; }
  StepperChoice& choice() { return step_.choice; }
  const MotionStatus& status() const { return step_.status; }
  Statistics& statistics() { return step_.statistics; }
  const Statistics& statistics() const { return step_.statistics; }
  /// The motion inside the last step.
  InsideStep& inside() { return inside_; }

  // --- beginnings ------------------------------------------------------------------------------
  /// Forgets everything but what is known of the start.
  void reset();
  /// A motion begins with the state x; inputs are as they are.
  void beginAt(const State& x);
  /// The same for the first time: with the stepper that suits its start, which later ones have,
  /// too.
  void beginFirstAt(const State& x);
  /// A motion goes on from a state of another one: at `time`, from x, where the accelerations are
  /// `epsilon`; inputs are as they are. Nothing of what this one has had before counts.
  void beginFrom(double time, const State& x, const double* epsilon,
                 const MotionState::History& history);
  /// Returns what the motion has behind it, but for its energy.
  MotionState::History history() const;
  /// There is no motion for the reason in `status`; x is where it would have begun.
  void beginNowhere(const State& x, const MotionStatus& status);
  /// Its first advance: from now on it is no start any more.
  void leaveStart() { step_.is_at_start = false; }
  bool isStart() const { return step_.is_at_start; }
  /// The motion goes on from `node`, at the instant `time` (s, from the motion's start): what is
  /// done to its inputs comes between this and `restart`. (A node may lie just behind an event at
  /// that instant.)
  void cutAt(double time, const StepNode& node);
  /// The end of the step is a new beginning (start, command, end of an input's segment):
  /// derivative, step.
  void restart();
  /// Back to the last good state: the start of the step.
  void stepBack() { step_.end = step_.start; }
  /// The jump map at the end of the step, from the inputs u0 to those that the signals now have.
  /// False when the motion stopped.
  bool jump(const double* u0) { return crossing_.jumpInputs(u0); }
  /// A command has come at `time`: steps end where the next one may be expected.
  void noteCommand(double time) { size_.noteCommand(time); }

  // --- steps -----------------------------------------------------------------------------------
  /// One accepted step from the end of the last one. False when the motion stopped, or an
  /// Interruption ended the attempts; then the end is where it was.
  bool step();
  /// After a step, whose energy is known by then: what ends on an event begins anew at once. False
  /// when the motion stopped.
  bool finishEnd();
  /// Stops at the instant `time` (s, from the motion's start) for a value that is not finite at
  /// (t, x).
  void stopAtBadValue(double time, double t, const State& x);
  /// Stops the motion for want of time behind `time`.
  void exhaustTime(double time);

 private:
  // The three beats of a step. False when the motion stopped.
  bool prepare();
  bool attempt();
  void conclude();

  /// False, and the motion stopped, when it gets nowhere.
  bool countStep();
  bool finishInputSegments();
  /// The event that was found by the last step is due: true when it is crossed.
  bool crossDueEvent();
  void moveOrigin(double t);
  /// The step ends at the origin of time, at x with the accelerations `epsilon`.
  void placeEnd(const State& x, const double* epsilon);

  CurrentStep step_;
  GuardSearch guards_;
  EventCrossing crossing_;
  EventHandler events_;
  StepSize size_;
  TrialSteps trials_;
  InsideStep inside_;
  bool starts_implicitly_ = false;
};

}  // namespace variator_sim
