/// Steps a motion freely: tries, judges, projects, accepts, crosses edges, rests, starts anew.
///
/// One accepted step goes from `base` to `front`:
///
///     step:                                          (Integrator::step)
///       an input's closed form ends here?   jump if it jumps there; a new beginning
///       an edge of a law is due here?       cross it by a series, jump by what the torque jumps
///       nothing special about this scene?   a whole step by series (makeWholeStep), or the next
///                                           one that was made with it; if it is good:
///                                           another stepper? at rest?
///       until a trial step is good:
///         try      from the base, at most to the end of reach      (Stepper::step)
///         project  the end onto the constraints                    (projectEnd)
///         judge    the estimate, the move, what no stage has seen  (StepChecks)
///         note     what its end tells beside x': Q', C
///         look     inside for edges of laws: the step is to end before the first one
///         shorter  by the worst of these, or where an edge is
///       check what the end told: Q', C (RowWatch); grow the next step
///       another stepper? (StepperChoice)  at rest? (Rest)
///
/// Steps of fixed size go through the same loop: theirs is good when it exists. Over an edge the
/// motion is a series, at rest it is not stepped at all (Course): both answer for the present as a
/// step does.
///
/// Times inside (of nodes, of inputs' closed forms) are counted from the last beginning.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/drivetrain.h"
#include "dynamics/principle_system.h"
#include "integrate/command_rhythm.h"
#include "integrate/guard_search.h"
#include "integrate/jump_map.h"
#include "integrate/progress.h"
#include "integrate/rest.h"
#include "integrate/row_watch.h"
#include "integrate/step_checks.h"
#include "integrate/step_control.h"
#include "integrate/step_curve.h"
#include "integrate/stepper_choice.h"
#include "integrate/time_origin.h"
#include "variator_sim/motion_state.h"
#include "variator_sim/status.h"

namespace variator_sim {

/// All are [loop].
class Integrator {
 public:
  /// Both have to outlive this.
  Integrator(PrincipleSystem& system, const Scene& scene);

  /// Where the last step began and ended.
  const StepNode& base() const { return base_; }
  const StepNode& front() const { return front_; }
  const TimeOrigin& origin() const { return origin_; }
  /// C at the front.
  const RowWatch::Row* rows() const { return rows_.rows(); }
  const StepperChoice& choice() const { return choice_; }
  const MotionStatus& status() const { return status_; }
  Statistics& statistics() { return statistics_; }
  const Statistics& statistics() const { return statistics_; }

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
  /// What it has behind it, but for its energy.
  MotionState::History history() const;
  /// There is no motion for the reason in `status`; x is where it would have begun.
  void beginNowhere(const State& x, const MotionStatus& status);
  /// Its first advance: from now on it is no start any more.
  void leaveStart() { is_start_ = false; }
  bool isStart() const { return is_start_; }
  /// The motion goes on from `node`, at the instant `time` (s, from the motion's start): what is
  /// done to its inputs comes between this and `restart`. (A node may lie just behind an edge at
  /// that instant.)
  void cutAt(double time, const StepNode& node);
  /// The front is a new beginning (start, command, end of an input's segment): derivative, step.
  void restart();
  /// Back to the last good state: the base.
  void stepBack() { front_ = base_; }
  /// The jump map at the front, from the inputs u0 to those that the signals now have. False when
  /// the motion stopped.
  bool jump(const double* u0);
  /// A command has come at `time`: steps end where the next one may be expected.
  void noteCommand(double time) { rhythm_.note(time); }

  // --- steps -----------------------------------------------------------------------------------
  /// One accepted step from the front. False when the motion stopped, or an Interruption ended the
  /// trials; then the front is where it was. Others may be made before it
  /// and passed over, as long as they do not come to `target` (s, from the motion's start, for the
  /// front may begin anew): whoever looks inside of each has it behind them.
  bool step(double target);
  /// Those steps, from `from` to the nodes.
  struct PassedSteps {
    explicit PassedSteps(const System& system) : from(system) {}
    StepNode from;
    const SeriesNode* begin = nullptr;
    const SeriesNode* end = nullptr;
  };
  const PassedSteps& passed() const { return passed_; }
  /// Stops at the instant `time` (s, from the motion's start) for a value that is not finite at
  /// (t, x).
  void stopAtBadValue(double time, double t, const State& x);
  /// Stops the motion for want of time behind `time`.
  void exhaustTime(double time) {
    status_.reason = StopReason::kTimeExhausted;
    status_.time = time;
  }

  /// After a step, whose energy is known by then: what ends on an edge begins anew at once. False
  /// when the motion stopped.
  bool finishEnd() {
    if (!is_end_on_edge_ || finishInputSegments()) return true;
    status_.time = absolute(front_.time);
    return false;
  }

  // --- rest ------------------------------------------------------------------------------------
  bool isSleeping() const { return course_ == Course::kRest; }
  /// Until when nothing is stepped.
  double sleepEnd() const { return sleep_end_; }
  /// The motion sleeps on from the end of its rest, or is stepped again. False when it stopped.
  bool finishSleep();
  /// x at `time` of a motion at rest: the front's, angles gone on at constant speed.
  void calcRest(double time, State& x) const;

  // --- inside the last step --------------------------------------------------------------------
  /// True when `now` lies within the last step, and not at its end.
  bool isInsideStep(double now) const { return base_.time < front_.time && now != front_.time; }
  /// A sample at `now` in one, where the stepper makes such. False where it is to be made from the
  /// state.
  bool calcSample(double now, Sample* sample);
  /// x at `now`, by dense output where the stepper has it. False where the motion stopped. `now`
  /// becomes the instant just behind an edge where it lies on one: x and laws are of one side.
  bool calcState(double* now, State& x);
  /// Steps from the base to `now`, which lies inside the last step, to the full order and with the
  /// full error control: what the motion continues from after a command. False, and the motion
  /// stopped, in the odd case that no step however short succeeds.
  bool reach(double now, StepNode* node);
  /// x at base + theta (front - base): within about the tolerance, not projected, and without a
  /// word in the status.
  void calcInside(double theta, State& x);

 private:
  /// How the motion goes where it was last moved.
  enum class Course {
    kStep,  ///< from base to front, by the stepper
    kHop,   ///< from base to front, over an edge, by a series
    kRest   ///< from the front on, without being stepped
  };
  /// x at `now` of a motion that is not stepped there, see calcState. False where it is.
  bool calcUnstepped(double* now, State& x);

  double absolute(double t) const { return origin_.absolute(t); }
  double relative(double time) const { return origin_.relative(time); }
  void moveOrigin(double t);

  /// Of the step before an edge, at least so much is tried behind it.
  static constexpr double kLeastRestart = 1e-8;
  /// A first step from the sizes of x, x' and the change of x' over a small Euler step
  /// (Hairer, Norsett, Wanner: Solving ODE I, II.4).
  double chooseFirstStep();
  /// The next step as the stepper knows it beforehand. False when it does not.
  bool letStepperChoose();

  /// The motion goes on from the front. False, and the motion stopped, when it gets nowhere.
  bool countStep();
  bool finishInputSegments();
  /// Nothing changes at the front, exactly.
  bool rests() const;
  bool makeStep(double target);
  /// The step, and those passed over before it, as the stepper makes them in one, where it does,
  /// nothing has an edge and no input moves. False: it is to be made the other way.
  bool makeWholeStep(double target);
  /// How many are made as far as `target`, each with what it came to. 0: none.
  int makeStepsAhead(double target, const SeriesNode** nodes);
  /// One of them is taken. False when it is no good after all.
  bool takeWholeStep(double from, const SeriesNode& to);
  void moveTo(const SeriesNode& made, StepNode* node) const;
  /// They are not good after all.
  void leaveWholeSteps();
  bool mayMakeWholeSteps() const {
    return may_make_whole_steps_ && !drivetrain_.haveInputsMoved() && stepper_->makesWholeSteps();
  }
  /// A step while it is looked for.
  struct Trial {
    double length = 0.0;       ///< that is wanted, s
    double taken = 0.0;        ///< that is tried, s
    double end = 0.0;          ///< where that ends
    double segment_end = 0.0;  ///< where it has to end
    bool is_last = false;      ///< it ends there
    int rejections = 0;
    int looks = 0;  ///< times that an edge made it shorter
    /// The step that would have been made but for an edge, s. Behind one of the state an implicit
    /// step begins anew: of its error, when it is much too long for what answers there, its
    /// estimate tells nothing.
    double usual = 0.0;
    int unresolved = 0;      ///< times that a formula made it shorter
    double grid = 0.0;       ///< the next multiple of a fixed step
    bool has_leapt = false;  ///< its accelerations were those of another branch
  };
  /// Tries steps from the base until one is good. False when the motion stopped.
  bool makeTrials();
  Trial firstTrial();
  /// Where the next trial goes. False when nothing so short can be stepped: an edge was crossed
  /// instead, or the motion stopped.
  bool aim(Trial& trial);
  /// A trial step from the base: step, projection and checks. The front is what it comes to, with
  /// its derivative where the returned error, in units of the tolerance, is good. The motion may
  /// have stopped.
  double attempt(const Trial& trial);
  /// True where no formula hides anything inside the step to the front, whose derivative is known.
  /// Steps by the series have seen to that themselves.
  bool isResolved(double taken);
  /// The error of a step is at most the tolerance; where steps are fixed, it only exists.
  bool isGood(double norm) const {
    return norm <= 1.0 || (choice_.isFixed() && std::isfinite(norm));
  }
  /// The trial is good by its error. False when its end is not, or when the motion stopped.
  bool accept(const Trial& trial, double norm);
  void chooseNextStep(const Trial& trial, double norm);
  /// False, and the motion stopped, when a fixed step is too long to describe anything.
  bool isFixedStepFine(double norm);
  /// It is not: the next length. False when an edge was crossed instead, or the motion stopped.
  bool refuse(Trial& trial, double norm);
  /// A jump just ahead of the base, if any, is crossed.
  bool hopOverJumpAhead();

  /// Accelerations that follow from the state have changed by more than the short step that is left
  /// after many refusals accounts for: they are those of another branch of psi = 0.
  bool haveAccelerationsLeapt() const;

  /// A step of length h from `from` to `end`, on the constraints: x there. The error, in units of
  /// the tolerance.
  double stepAndProject(Stepper& stepper, const StepNode& from, double end, double h, State& x);

  /// Where a step from the base has to end at the latest: the end of an input's segment, an instant
  /// at which a law is not smooth, or where a command is expected.
  double endOfReach() const;

  /// Projects x, to which `stepper` has gone from x_old by h and which stands at `end`; the size of
  /// the move in units of the tolerance (an error measure that is independent of the stepper's), or
  /// NaN when it failed.
  ///
  /// What rounding alone makes of it counts for nothing: shorter steps do not help. It is looked at
  /// where the move is more than a step's own error `estimate`.
  double projectEnd(const Stepper& stepper, const State& x_old, double end, double h,
                    double estimate, State& x);

  /// The size of a move onto the constraints without what rounding makes of it; where that is more
  /// than the tolerance it is told.
  double discountRounding(double end, const State& x_old, const State& x, const State& moved);

  /// What rounding makes of a move onto the constraints at x, component by component; the largest,
  /// in tolerances.
  double calcRounding(double end, const State& x, State& rounding);
  /// Tells of it where it is more than the tolerance.
  void noteRounding(double largest);

  /// x' at the new front. False when it is not finite.
  bool differentiateFront();

  /// What the derivative just taken at the front tells beside x': Q', C, whether it lies in a
  /// corner of psi.
  void noteDerivative();

  /// The checks of Q' and C at the new front. False when it is no good: then either the motion has
  /// stopped or the step is to be repeated shorter.
  bool finishStep();

  /// The stepper has changed: its order chooses the size of steps, without a past.
  void followChoice();
  /// True when the motion is at rest from the front on. `rate`: its largest, in tolerances per s.
  bool lookForRest(double* rate);
  /// After an accepted step of adaptive size: another stepper for the next one? at rest?
  void lookAhead();

  /// The larger one of `norm` and a check; of one that is passed only so much counts that steps
  /// stay about as long as they are.
  static double worseOfCheck(double norm, double check) {
    return worseOf(norm, check <= 1.0 ? std::min(check, kSteady) : check);
  }

  /// True, and the motion stopped at the base, when the accelerations that follow from the state
  /// are not known to the tolerance any more.
  bool stopWhereToleranceIsLost();

  /// From the front on nothing is stepped until the end of the term (rest.h). False when that is
  /// too short to be worth its search.
  bool fallAsleep();

  /// What the rows of C tell at the front. False when it is no good; where one has vanished the
  /// motion has stopped.
  bool noteRows();

  void copyInputs(double* u) const {
    std::copy(drivetrain_.inputs(), drivetrain_.inputs() + drivetrain_.inputCount(), u);
  }
  /// Whether an input is not what it was, beyond rounding.
  bool haveInputsJumped(const double* u0) const;

  // --- edges: where a law changes its branch ---------------------------------------------------
  enum class Look {
    kClear,    ///< no edge inside
    kShorter,  ///< the step is to be made again, shorter
    kCrossed   ///< the edge was at the base: the step went across it, and no further
  };

  /// The front is where the next step begins. (Accelerations of least reaction that go on in a
  /// corner of psi only seem to leave it: least_reaction.h.)
  void moveGuards();

  /// The state of a node whose derivative is known.
  StateView viewOf(const StepNode& node);
  CurveEnd curveEnd(const StepNode& node) const;

  /// Whether any law leaves its branch within the step of length `taken` from the base to the
  /// front, whose derivative is known. kShorter: it has to be made again with the length `next`, to
  /// shortly before the first edge.
  Look lookInside(double taken, double* next);
  /// Nothing moves by more than its tolerance from the base to the front.
  bool isStill(const StateBox& box) const;
  /// In such a step the torques behind an edge of the state are those before it: rounding decides
  /// the side, and it makes no difference.
  bool isHarmless(int guard, const StateView& beyond);
  /// The step to the front meets edges by the time alone, and the torque, which is integrated, is
  /// compared at its end: the one behind may be as long as it would have been.
  bool isEdgeOfTime(double taken);
  /// A step that ends on an edge and goes on beyond it is made again, to shortly before it:
  /// standing on it no branch is that of the motion.
  bool endsOnEdge(double taken);
  /// The guard on whose edge, or within rounding of it, the front lies; of a jump. -1: there is
  /// none.
  int nearJump();
  Look shortOfEnd(double taken, double* next);
  /// The same for a step whose error was too large: whether it ended beyond an edge.
  Look lookAtEnd(double taken, double* next);

  /// The first edge along the curve: crossed where it is at the base, the step to it otherwise.
  Look aimAtEdge(double taken, double* next);
  /// An edge that was found by a longer step stays the next one only when this one ends there.
  Look keepCrossing();
  /// The one that may have been due at the base is not there.
  void forgetCrossing(bool was_due);

  /// The motion inside the step from base to front as polynomials: by the dense output where there
  /// is one, and else by shorter steps from the base.
  void traceStep(double taken);

  /// The beginning of a motion on the edge of a jump: which of both branches it takes is to be seen
  /// at once.
  void meetEdgeAtStart();

  /// A motion that begins in a corner of psi (a zero of abs(e1), say, where the least reaction
  /// often lies): C is another one on each of its sides, and the motion takes the side on which its
  /// own jerk leads away from the corner. False, and the motion stopped, when neither side or
  /// either does.
  bool leaveCorner();
  /// Moves the accelerations of a node in a corner to where `kink`, whose gradient is G, has about
  /// the value `distance`, along psi = 0. False where the jerk there leads back into the corner.
  bool moveAside(const Constraint& kink, const double* G, double distance, StepNode& node);

  /// x at a short time after a node, by what is known there: Taylor's series.
  State goAhead(const StepNode& from, double length) const;

  /// A step over the edge that lies just ahead of the base, to as little beyond it as can be told:
  /// so short that a series from the base will do, and that no stepper makes stages on both sides.
  /// A torque that bends or jumps there moves the accelerations by the jump map. False, and nothing
  /// done, when the edge is not there, or when the motion stopped.
  bool crossEdge();

  /// Whether the accelerations at two lengths next to each other are not the same. `go` brings the
  /// front there, with its derivative.
  template <class Go>
  bool haveAccelerationsJumped(const Go& go, double before, double beyond);

  /// The length of the step over an edge at the length `beyond`, by `depth` at least and `most` at
  /// the most, that brings the argument of `guard` out of rounding: the side is decided once.
  double leaveRounding(int guard, double beyond, double depth, double most);
  /// The step across an edge that lies where an input's closed form ends goes as far as there: the
  /// beginning there decides, with all that begins at that instant. False when it is too long.
  bool goToSegmentEnd();

  /// Whether the series from the base is good up to `length` from there, still on its branch: the
  /// rate of the velocities there is what it says, within the tolerance that they make of it.
  bool isSeriesGood(double length);

  /// The jump that the series from the base meets within `reach`, if any.
  bool crossJumpAhead(double reach);

  /// The front, where x is about to be that of the other side of an edge, `late` s behind it:
  /// projection, jumps, derivative.
  bool enterBranch(double late);
  bool refuseEdge();

  /// The jump map by what the torque at the front is more than its rate at the base tells.
  bool jumpOverEdge(double late);
  /// The jump map at the front, where the torque was `before` (N m, S values).
  bool jumpFrom(const double* before);
  /// The series has gone on behind the edge for `late` s with the accelerations before it: moves x
  /// to what those behind it, which differ by `change`, make of that time. False: not projected.
  bool catchUp(const double* change, double late);
  /// x' at the front, behind a jump of accelerations that follow from the state, and that move.
  bool differentiateBehind(double late);

  /// After `guard` was left for `branch` by a step: false, and the motion stopped, when
  /// the motion turns back at once. What jumps tells so at once; a kink may be touched.
  /// `depth`, s: so far beyond the edge did the step go. The motion stops at `edge`.
  bool noteCrossing(int guard, int branch, double depth, double edge);
  /// The motion ends at `time`, just before the edge that the series from the base has met: where
  /// that is does not depend on how long the last step was.
  void goToEdge(double time);

  // --- stops -----------------------------------------------------------------------------------
  void stop(StopReason reason);
  /// Neither branch of `guard` goes on.
  void stopChattering(int guard);
  /// Stops at the front, where no step however short succeeds, and finds out why (diagnosis.h);
  /// `otherwise` is the reason where nothing more is found.
  void explainStop(StopReason otherwise = StopReason::kStepUnderflow);

  /// Error of one fixed step, relative to the state (and to absolute / relative tolerance where
  /// that is larger), above which the motion stops.
  static constexpr double kCrudest = 0.1;
  /// So many rejections of one step make `auto` try implicitly.
  static constexpr int kHopeless = 6;
  /// Halvings of a step for what a formula may hide: of one so short its stages have seen all.
  static constexpr int kMostUnresolved = 20;
  /// An error norm that makes StepControl take a step no shorter, at every order.
  static constexpr double kSteady = 0.1;
  /// A step made with more ease than this does not shorten the next one for that alone.
  static constexpr double kEasy = 0.75;
  /// A whole step that was moved by more than this may have been so by rounding.
  static constexpr double kMoved = 0.5;
  /// An edge is found to within this part of the step, and the step made again ends by this part
  /// before it.
  static constexpr double kEdgeResolution = 1e-14;
  static constexpr double kMargin = 1e-7;
  /// Trial steps that look for an edge from one base.
  static constexpr int kMostLooks = 100;
  /// So many edges that refused steps told of, and that were not there, make no more be told of.
  static constexpr int kMostFalseGuesses = 5;
  /// An edge is crossed back at once when that takes so many times what going beyond it took.
  static constexpr double kAtOnce = 100.0;
  /// After so many refusals of a step a jump is looked for, at most so far (of the longest step).
  static constexpr int kHardPressed = 4;
  static constexpr double kAhead = 1e-4;
  /// Tolerances by which accelerations may be moved to restore what no constraint can change of the
  /// reaction: little by little where a torque answers steeply to angles or velocities, which is
  /// not to make their errors those of the accelerations; at once where none does, or where one has
  /// just changed its branch, as it must be.
  static constexpr double kLittle = 0.1;
  static constexpr double kAnyway = std::numeric_limits<double>::infinity();
  /// What stands for the error of a step with stages on both sides of a jump.
  static constexpr double kStagesLeft = 100.0;
  /// Relative to the accelerations: so near to a corner a start lies in it.
  static constexpr double kCorner = 1e-11;
  /// A kink that is crossed so often at once is not merely touched.
  static constexpr int kMostTouches = 10;
  /// The motion sleeps for so many of its longest steps at least.
  static constexpr double kLeastSleep = 20.0;
  /// Steps from `time` are longer than this. [loop]
  static double shortestStep(double time) { return resolutionOf(time); }

  const int S;  // shafts
  const bool integrates_torque_;
  bool may_make_whole_steps_ = false;
  PassedSteps passed_;
  const SolverSettings& settings_;
  PrincipleSystem& system_;
  Drivetrain& drivetrain_;  // the system's
  StepperChoice choice_;
  Stepper* stepper_;  // that made the last step
  Tolerance tolerance_;
  StepChecks checks_;
  JumpMap jump_map_;
  StepControl control_;
  Rest rest_;
  RowWatch rows_;
  GuardSearch guards_;
  JumpWatch watch_{guards_};
  StepCurve curve_;
  CommandRhythm rhythm_;
  TimeOrigin origin_;
  MotionStatus status_;
  Statistics statistics_;

  bool is_start_ = true;  // nothing has moved yet
  bool starts_implicitly_ = false;
  Course course_ = Course::kStep;
  bool is_still_ = false;      // the last trial step that was looked into
  bool is_in_corner_ = false;  // of psi: the front
  double sleep_end_ = 0.0;
  State left_at_sleep_end_;  // the deviation c there

  StepNode base_;   // where the last step began
  StepNode front_;  // where it ended
  double next_step_ = 0.0;
  bool is_step_chosen_ = false;  // by the stepper
  double own_norm_ = 0.0;        // of the last trial step: its own estimate, without checks
  Progress progress_;
  double restart_time_ = 0.0;  // fixed steps count from here
  std::uint64_t fixed_steps_ = 0;

  Crossing crossing_;
  LastCrossing last_crossing_;
  /// The front, where an input's closed form ends, lies on an edge, and its torque is that before.
  bool is_end_on_edge_ = false;
};

}  // namespace variator_sim
