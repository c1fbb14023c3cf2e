/// The motion of a scene by one system of equations: steps, rejects, projects, jumps, samples.
///
/// The integrator runs freely ahead of the present, by steps of its own choice: `base` to `front`
/// is its last step and the present lies in it. Samples are taken from inside that step and
/// commands cut it, so that nobody's sampling rate, tick or advance changes one bit of the motion.
///
/// Times inside (of nodes, of inputs' closed forms) are counted from the last beginning (start,
/// command, jump), so that what follows is resolved as finely after 1e7 s as after none.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "command_rhythm.h"
#include "drivetrain.h"
#include "energy.h"
#include "guard_search.h"
#include "initial_conditions.h"
#include "principle_system.h"
#include "projection.h"
#include "rest.h"
#include "step_checks.h"
#include "step_control.h"
#include "step_curve.h"
#include "stepper_choice.h"
#include "variator_sim/simulation.h"

namespace variator_sim {

/// The system of a scene's principle and orders.
std::unique_ptr<PrincipleSystem> makeSystem(const Scene& scene);

/// See Simulation for what each public method promises.
class Motion {
 public:
  explicit Motion(Scene scene);

  const Scene& scene() const { return scene_; }
  double time() const { return time_; }
  const MotionStatus& status() const { return status_; }
  const char* stepperName() const { return choice_.stepper().name(); }
  std::string describeStepper() const { return choice_.describe(); }
  std::vector<std::string> skips() const;
  bool isSleeping() const { return sleeping_; }
  void reset() { startOver(); }

  const Statistics& statistics() const;

  const MotionStatus& advanceTo(double time);

  double quietUntil() const;

  CommandResult command(int input, double value);

  const Sample& sample();

  void trackEnergy(bool on);
  Energy energy();
  EnergyDoubt energyDoubt() const;

  void calcConstraintRow(int m, double* C);

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  // --- times -----------------------------------------------------------------------------------
  double absolute(double t) const { return origin_ + (origin_rest_ + t); }
  double relative(double time) const { return (time - origin_) - origin_rest_; }
  /// The present as nodes count it.
  double present() const { return relative(time_); }
  /// True when the present lies within the last step, and not at its end.
  bool isInsideStep() const { return base_.time < front_.time && present() != front_.time; }
  /// Counts times from the present on, which is 0 then to the bit.
  void moveOriginToPresent();
  /// Counts times from `t`, as they are counted now, on.
  void moveOrigin(double t);

  bool isSampleFinite() const;

  const MotionStatus& advance(double time);

  // --- start -----------------------------------------------------------------------------------
  void startOver();

  /// The state at time 0 with the inputs as they are.
  void start();

  /// The front is a new beginning (start, command, end of an input's segment): derivative, step.
  void restart();

  /// Of the step before an edge, at least so much is tried behind it.
  static constexpr double kLeastRestart = 1e-8;
  /// A first step from the sizes of x, x' and the change of x' over a small Euler step
  /// (Hairer, Norsett, Wanner: Solving ODE I, II.4).
  double chooseFirstStep();

  // --- free stepping ---------------------------------------------------------------------------
  /// Brings the present to `time`.
  void moveTo(double time);

  /// The limit of steps is one per simulated time and not per advance: how a motion is cut may not
  /// change it.
  bool countStep();

  /// One accepted step from the front. False when the motion stopped.
  bool step();

  bool stepAdaptively();

  /// Where a step from the base has to end at the latest: the end of an input's segment, an instant
  /// at which a law is not smooth, or where a command is expected.
  double endOfReach() const;

  // --- edges: where a law changes its branch ---------------------------------------------------
  enum class Look {
    kClear,    ///< no edge inside
    kShorter,  ///< the step is to be made again, shorter
    kCrossed   ///< the edge was at the base: the step went across it, and no further
  };

  /// The front is where the next step begins. Accelerations of least reaction that go on in a
  /// corner of psi (least_reaction.h) only seem to leave it, to either side, by rounding.
  void moveGuards();

  /// The state of a node whose derivative is known.
  StateView viewOf(const StepNode& node);
  CurveEnd curveEnd(const StepNode& node) const;

  /// Whether any law leaves its branch within the step of length `taken` from the base to the
  /// front, whose derivative is known. kShorter: it has to be made again with the length `next`, to
  /// shortly before the first edge.
  Look lookInside(double taken, double* next);
  /// The same for a step whose error was too large: whether it ended beyond an edge.
  Look lookAtEnd(double taken, double* next);

  /// The first edge along the curve: crossed where it is at the base, the step to it otherwise.
  Look aimAtEdge(double taken, double* next, bool may_cross = true);
  /// An edge that was found by a longer step stays the next one only when this one ends there.
  Look keepCrossing();

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
  bool haveAccelerationsJumped(const Go& go, double before, double beyond) {
    constexpr double kJump = 1e-5;
    go(before);
    const State first = front_.dxdt;
    go(beyond);
    for (int n = first.size() - S; n < first.size(); ++n) {
      const double size = 1.0 + std::abs(first[n]);
      if (!(std::abs(front_.dxdt[n] - first[n]) <= kJump * size)) return true;
    }
    return false;
  }

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

  /// After `guard` was left for `branch` by a step: false, and the motion stopped, when
  /// the motion turns back at once. What jumps tells so at once; a kink may be touched.
  /// `depth`, s: so far beyond the edge did the step go.
  bool noteCrossing(int guard, int branch, double depth);

  bool stepFixed();

  /// Projects x, to which `stepper` has gone from x_old by h and which stands at `end`, if the
  /// stepper has not done so; the size of the move in units of the tolerance (an error measure that
  /// is independent of the stepper's), or NaN when it failed.
  ///
  /// What rounding alone makes of it counts for nothing: shorter steps do not help. It is looked at
  /// where the move is more than a step's own error `estimate`.
  double projectEnd(const Stepper& stepper, const State& x_old, double end, double h,
                    double estimate, State& x);

  /// The size of a move onto the constraints without what rounding makes of it; where that is more
  /// than the tolerance it is told.
  double discountRounding(double end, const State& x_old, const State& x, const State& moved);

  /// x' at the new front. False when it is not finite.
  bool differentiateFront();

  /// The checks of Q' and C at the new front, whose derivative was the last one taken. False when
  /// the front is no good: then either the motion has stopped or the step is to be repeated
  /// shorter.
  bool finishStep();

  /// After an accepted step of adaptive size: another stepper for the next one? at rest?
  void lookAhead();

  /// The larger one of `norm` and a check; of one that is passed only so much counts that steps
  /// stay about as long as they are.
  static double worseOfCheck(double norm, double check) {
    return worseOf(norm, check <= 1.0 ? std::min(check, kSteady) : check);
  }

  double checkAccelerations();
  /// True, and the motion stopped at the base, when the accelerations that follow from the state
  /// are not known to the tolerance any more.
  bool stopWhereToleranceIsLost();

  /// From the front on nothing is stepped until the end of the term (rest.h). False when that is
  /// too short to be worth its search.
  bool fallAsleep();
  /// The front goes to the end of the term; the motion sleeps on from there, or is stepped again.
  /// False when it stopped.
  bool finishSleep();
  /// x at `time` of a motion at rest: the front's, angles gone on at constant speed.
  void calcRest(double time, State& x) const;

  /// Compares the rows of C with the longest that each has been. False, and the motion stopped,
  /// when one has vanished.
  bool noteRows();

  /// True when a row of C has turned by more than 90 degrees (in the metric J^-1) since the base:
  /// no step that follows C does that, but one that passes over a zero of C does, and on the other
  /// side the motion is not determined. Keeps the rows of the front otherwise.
  bool haveRowsTurned();

  /// The rows of C at the next front are not compared with those before.
  void noteRowsAnew() { has_new_rows_ = true; }

  /// Stops at the front, where no step however short succeeds, and finds out why; `otherwise` is
  /// the reason where nothing more is found.
  void explainStop(StopReason otherwise = StopReason::kStepUnderflow);

  /// Names a value that is not finite at (t, x) in the status: a torque, a constraint, or, under
  /// the classical principle, accelerations that do not exist. False when there is none.
  bool nameBadValue(double t, const State& x);

  void stop(StopReason reason);

  // --- inside the last step --------------------------------------------------------------------
  bool isDenseOutputGood() const;
  /// x at the present, by dense output where the stepper has it.
  void sampleInside(State& x);

  /// Steps from the base to the present, which lies inside the last step, to the full order and
  /// with the full error control: what the motion continues from after a command.
  /// False, and the motion stopped at the base, in the odd case that no step however short
  /// succeeds.
  bool reachPresent(StepNode* node);

  // --- energy ----------------------------------------------------------------------------------
  /// The step from the base to the front was accepted.
  void noteEnergy();
  /// The motion goes on from `present`, inside the last step or at rest.
  void cutEnergy(const StepNode& present);
  /// The applied energy at the present, J.
  double calcApplied();
  /// x at base + theta (front - base): within about the tolerance, not projected, and without a
  /// word in the motion's status.
  void calcInside(double theta, State& x);

  // --- commands --------------------------------------------------------------------------------
  /// Of several commands to one input the last one counts.
  void stage(int input, double value);

  double nextTimeout() const;

  /// The inputs whose command is overdue at the present.
  void applyTimeouts();

  /// All pending commands take effect at the present, together: inputs that jump move on the
  /// straight line between their old and new values, so that no order means anything.
  void applyPending();

  void copyInputs(double* u) const {
    std::copy(drivetrain_.inputs(), drivetrain_.inputs() + drivetrain_.inputCount(), u);
  }
  /// Whether an input is not what it was, beyond rounding.
  bool haveInputsJumped(const double* u0) const;

  /// The jump map at the front, from the inputs u0 to those that the signals now have. False when
  /// the motion stopped.
  bool jump(const double* u0);

  /// Commands before the first instant: a zero-order one is the initial value, no jump, so the
  /// accelerations of least reaction are those with it; the others set targets.
  void applyInitialCommands(int count);

  // --- messages --------------------------------------------------------------------------------
  void writeResiduals(std::ostream& text, const StateView& state) const;

  [[noreturn]] void throwInitialError();

  /// Error of one fixed step, relative to the state (and to absolute / relative tolerance where
  /// that is larger), above which the motion stops.
  static constexpr double kCrudest = 0.1;
  /// So many rejections of one step make `auto` try implicitly.
  static constexpr int kHopeless = 6;
  /// An error norm that makes StepControl take a step no shorter, at every order.
  static constexpr double kSteady = 0.1;
  /// An edge is found to within this part of the step, and the step made again ends by this part
  /// before it.
  static constexpr double kEdgeResolution = 1e-14;
  static constexpr double kMargin = 1e-7;
  /// Trial steps that look for an edge from one base.
  static constexpr int kMostLooks = 100;
  /// An edge is crossed back at once when that takes so many times what going beyond it took.
  static constexpr double kAtOnce = 100.0;
  /// After so many refusals of a step a jump is looked for, at most so far (of the longest step).
  static constexpr int kHardPressed = 4;
  static constexpr double kAhead = 1e-4;
  /// Tolerances by which accelerations may be moved to restore what no constraint can change of the
  /// reaction: little by little, for what a step leaves is less than its tolerance, and a torque
  /// that answers steeply to the velocities is not to make their errors those of the accelerations;
  /// and where the torque has just changed its branch, as it must be.
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
  static double shortestStep(double time) { return kResolution * std::abs(time); }
  /// Relative to the time reached: shorter steps no longer change the time reliably.
  static constexpr double kResolution = 4.0 * std::numeric_limits<double>::epsilon();
  /// A row of C shorter than this part of the longest it has been counts as zero.
  static constexpr double kVanished = 1e-10;

  Scene scene_;
  std::unique_ptr<PrincipleSystem> own_system_;
  PrincipleSystem& system_;
  const int S;  // shafts
  const bool integrates_torque_;
  Drivetrain& drivetrain_;  // the system's
  StepperChoice choice_;
  Stepper* stepper_;  // that made the last step
  Tolerance tolerance_;
  StepChecks checks_;
  EnergyMeter energy_;
  StepControl control_;
  Rest rest_;
  GuardSearch guards_;
  JumpWatch watch_{guards_};
  StepCurve curve_;
  CommandRhythm rhythm_;
  bool hopped_ = false;  // the last step was one over an edge
  bool sleeping_ = false;
  double sleep_end_ = 0.0;
  State left_at_sleep_end_;  // the deviation c there
  bool knows_start_ = false;
  State start_;  // at time 0, with the inputs as the scene has them
  bool starts_implicitly_ = false;

  MotionStatus status_;
  mutable Statistics statistics_;
  InitialResult initial_result_ = InitialResult::kConsistent;
  bool velocities_at_fault_ = false;
  double nearest_[kMaxShafts] = {};

  double time_ = 0.0;         // the present
  double origin_ = 0.0;       // what times of nodes are counted from
  double origin_rest_ = 0.0;  // what a double rounds off that
  StepNode base_;             // where the last step began
  StepNode front_;            // where it ended
  State dxdt_new_;            // the stepper's own derivative at the front, before the projection
  double next_step_ = 0.0;
  double step_window_start_ = 0.0;
  int steps_in_window_ = 0;
  double restart_time_ = 0.0;  // fixed steps count from here
  std::uint64_t fixed_steps_ = 0;
  double row_reference_[kMaxRows] = {};
  double row_before_[kMaxRows][kMaxShafts] = {};  // C at the last front

  /// The edge that comes next.
  struct Crossing {
    int guard = -1;
    int side = 0;         // that it leaves
    double at = 0.0;      // where the step before it ends
    double length = 0.0;  // of the step across, s
    // the next step where it is not there after all, s
    double otherwise = std::numeric_limits<double>::infinity();
    bool isDueAt(double time) const { return guard >= 0 && at == time; }
  };
  Crossing crossing_;
  /// The last edge that was crossed.
  struct LastCrossing {
    int guard = -1;
    double time = 0.0;
    double depth = 0.0;
    int count = 0;  // of crossings of it before, each at once after the other
  };
  LastCrossing last_crossing_;
  bool has_new_rows_ = false;

  struct Pending {
    int input;
    double value;
  };
  Pending pending_[kMaxInputs];
  int pending_count_ = 0;
  double last_command_time_[kMaxInputs];
  bool advanced_ = false;

  Sample sample_;
  bool sample_valid_ = false;
};

}  // namespace variator_sim
