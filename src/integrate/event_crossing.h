/// Across an event, where a law changes its branch: by a series, to a little behind it.
#pragma once

#include <limits>

#include "integrate/current_step.h"
#include "integrate/guard_search.h"
#include "integrate/jump_map.h"

namespace variator_sim {

/// The event that comes next.
struct NextEvent {
  int guard = -1;
  int side = 0;           ///< that it leaves
  double at = 0.0;        ///< where the step before it ends
  double length = 0.0;    ///< of the step across, s
  bool is_guess = false;  ///< told by a step that was rejected
  /// The next step where it is not there after all, s.
  double otherwise = std::numeric_limits<double>::infinity();
  bool isDueAt(double time) const { return guard >= 0 && at == time; }
};

/// All are [loop].
class EventCrossing : private StepPart {
 public:
  EventCrossing(CurrentStep& step, const Scene& scene, GuardSearch& guards)
      : StepPart(step), guards_(guards), jump_map_(step.system, scene.solver) {}

  /// Forgets all that was crossed.
  void reset();
  /// The motion begins anew at the end of the step.
  void restart();

  NextEvent& next() { return next_; }
  const NextEvent& next() const { return next_; }
  /// Events that rejected steps told of since the last one and that were not there.
  int falseGuesses() const { return last_.false_guesses; }
  /// The next event, which may have been due at the start of the step, is not there.
  void forgetNext(bool was_due);
  /// True if the event of `guard` was due at the start of the step, and was not there.
  bool wasAbsent(int guard) const { return guard == absent_.guard && start_.time == absent_.time; }

  /// A new step begins at its end: guards have the branches that they have there. (Accelerations of
  /// least reaction that go on in a corner of psi only seem to leave it: least_reaction.h.)
  void updateBranches();
  /// The guard on whose edge, or within rounding of it, the end lies, of a law that jumps there;
  /// -1: there is none.
  int findJumpNear();

  /// Steps over the event that lies just ahead of the start, to as little beyond it as can be told:
  /// so short that a series from the start will do, and that no stepper makes stages on both sides.
  /// A torque that bends or jumps there moves the accelerations by the jump map. False, and nothing
  /// done, when the event is not there, or when the motion stopped.
  bool cross();
  /// The same for the jump that the series from the start meets shortly ahead, if any.
  bool crossJumpAhead();

  /// The end, where an input's closed form ends, lies on an event, and its torque is that before.
  bool isEndOnEvent() const { return is_end_on_event_; }
  /// The jump map at such an end. False when the motion stopped.
  bool finishEnd();
  /// The jump map at the end, from the inputs u0 to those that the signals now have. False when the
  /// motion stopped.
  bool jumpInputs(const double* u0);

 private:
  /// An event while it is bracketed by lengths of the step.
  struct Bracket {
    int guard;
    bool begins_on_event;  ///< the motion goes to the side on which it is beyond rounding
    /// Accelerations that the principle gives are known at a state, not along a series. They may go
    /// on in the corner that an event is for them (least_reaction.h).
    bool follows;
    /// An argument may come to its edge and stay there: a law that jumps has a value of its own
    /// then.
    bool settles = false;
    int branch = Guard::kOnEdge;  ///< at the last length
    double most = 0.0;            ///< of the lengths: where an input's closed form ends
    double before = 0.0;
    double beyond = 0.0;
  };

  /// Steps across without a word of it in the phase.
  bool stepAcross();
  /// Brings the end to `length`: true where that is beyond the event.
  bool isBeyond(Bracket& event, double length);
  /// Lengthens the step until it ends beyond the event. False when the event is not there.
  bool findBeyond(Bracket& event, double resolution);
  /// Halves until nothing lies between a length before the event and one beyond it, or, by many
  /// halvings, no more than `resolution`.
  void narrow(Bracket& event, double resolution);
  /// Whether the accelerations at two lengths next to each other are not the same.
  bool haveAccelerationsJumped(Bracket& event, double beyond);
  /// The length of the step over an event at the length `beyond`, by `depth` at least and `most` at
  /// the most, that brings the argument of `guard` out of rounding: the side is decided once.
  double leaveRounding(int guard, double beyond, double depth, double most);
  /// Steps across an event that lies where an input's closed form ends only as far as there: the
  /// beginning there decides, with all that begins at that instant. False when it is too long.
  bool goToSegmentEnd();
  /// Whether the series from the start is good up to `length` from there, still on its branch: the
  /// rate of the velocities there is what it says, within the tolerance that they make of it.
  bool isSeriesGood(double length);
  /// The same at points before it, too: a bump on the way, which is 0 at both ends, shows there.
  bool isSeriesGoodUpTo(double length);

  /// Moves the end, where x is about to be that of the other side of an event, `late` s behind it:
  /// projection, jumps, derivative.
  bool enterBranch(double late);
  /// The changes at the end that the guards make which have left their branches there.
  struct Change {
    bool torque_jumps = false;
    bool kinks_velocity_row = false;  ///< f' = 0 asks for other accelerations
    int jumping_row = -1;             ///< a constraint that itself jumps
  };
  Change findChange();
  /// Puts the end onto the constraints behind the event.
  bool projectBehind(const Change& change);
  bool reject();

  /// The jump map by what the torque at the end is more than its rate at the start tells.
  bool jumpTorque(double late);
  /// The jump map at the end, where the torque was `before` (N m, S values).
  bool jumpFrom(const double* before);
  /// True when the result of a jump is ok; the motion has stopped with it otherwise.
  bool acceptJump(const MotionStatus& result);
  /// The series has gone on behind the event for `late` s with the accelerations before it: moves x
  /// to what those behind it, which differ by `change`, make of that time. False: not projected.
  bool catchUp(const double* change, double late);
  /// x' at the end, behind a jump of accelerations that follow from the state, and that move.
  bool differentiateBehind(double late);

  /// After `guard` was left for `branch` by a step: false, and the motion stopped, when
  /// the motion turns back at once. What jumps tells so at once; a kink may be touched.
  /// `depth`, s: so far beyond the event did the step go. The motion stops at `event`.
  bool noteCrossing(int guard, int branch, double depth, double event);
  /// Ends the motion at `time`, just before the event that the series from the start has met: where
  /// that is does not depend on how long the last step was.
  void returnTo(double time);

  /// The last event that was crossed.
  struct LastEvent {
    int guard = -1;
    int branch = 0;  ///< that was entered
    double time = 0.0;
    double depth = 0.0;
    int count = 0;          ///< of crossings of it before, each at once back after the other
    int false_guesses = 0;  ///< since then: events of rejected steps that were not there
  };

  GuardSearch& guards_;
  JumpMap jump_map_;
  NextEvent next_;
  LastEvent last_;
  struct {
    int guard = -1;
    double time = 0.0;
  } absent_;
  bool is_end_on_event_ = false;
};

}  // namespace variator_sim
