/// Attempts a step from its start until one is accepted.
#pragma once

#include "integrate/current_step.h"
#include "integrate/event_handler.h"
#include "integrate/step_size.h"

namespace variator_sim {

/// All are [loop].
class TrialSteps : private StepPart {
 public:
  TrialSteps(CurrentStep& step, GuardSearch& guards, EventCrossing& crossing, EventHandler& events,
             StepSize& size);

  /// The motion begins anew: fixed steps count from there.
  void restart();
  /// False when the motion stopped, or an Interruption ended the attempts.
  bool make();

 private:
  /// A step while it is attempted.
  struct Trial {
    double length = 0.0;       ///< that is wanted, s
    double taken = 0.0;        ///< that is tried, s
    double end = 0.0;          ///< where that ends
    double segment_end = 0.0;  ///< where it has to end
    bool is_last = false;      ///< it ends there
    int rejections = 0;
    int searches = 0;  ///< times that an event made it shorter
    /// The step that would have been made but for an event, s. Behind one of the state an implicit
    /// step begins anew: of its error, when it is much too long for what answers there, its
    /// estimate tells nothing.
    double usual = 0.0;
    int unresolved = 0;  ///< times that a formula made it shorter
    double grid = 0.0;   ///< the next multiple of a fixed step
  };
  Trial first();
  /// Finds where the next attempt goes. False when nothing so short can be stepped: an event was
  /// crossed instead, or the motion stopped.
  bool aim(Trial& trial);
  /// Attempts a step: step, projection and checks. The end is what it comes to, with its derivative
  /// where the returned error, in units of the tolerance, is good. The motion may have stopped.
  double attempt(const Trial& trial);
  /// Whether events have made the attempt, whose error is `norm`, shorter or were crossed. A torque
  /// that jumps may have been met by the stages and not by the motion: then `norm` is one too
  /// large.
  EventHandler::Finding locateEvents(Trial& trial, bool stages_left, double* norm);
  /// Whether a formula hides something in the attempt, whose error is good: it is to be made again,
  /// shorter, then.
  bool isHiding(Trial& trial, double norm);
  /// Accepts the attempt, which is good by its error. False when its end is not, or when the motion
  /// stopped.
  bool accept(const Trial& trial, double norm);
  /// Rejects it: the next length. False when an event was crossed instead, or the motion stopped.
  bool reject(Trial& trial, double norm);

  /// True where no formula hides anything inside the step to the end, whose derivative is known.
  /// Steps by the series have seen to that themselves.
  bool isResolved(double taken);
  void chooseNextStep(const Trial& trial, double norm);
  /// False, and the motion stopped, when a fixed step is too long to describe anything.
  bool isFixedStepFine(double norm);
  /// True when accelerations that follow from the state have gone to another branch of psi = 0 in
  /// the attempt. Its error need not show that: all stages of an implicit step may lie there.
  bool haveAccelerationsLeapt();
  /// True, and the motion stopped at the start, when the accelerations that follow from the state
  /// are not known to the tolerance any more.
  bool stopWhereToleranceIsLost();

  /// After so many rejections of a step a jump is looked for.
  static constexpr int kRejectionsBeforeJump = 4;
  /// So many rejections of one step make `auto` try implicitly.
  static constexpr int kMaxRejections = 6;

  GuardSearch& guards_;
  EventCrossing& crossing_;
  EventHandler& events_;
  StepSize& size_;
  JumpWatch watch_;
  double own_norm_ = 0.0;      // of the last attempt: its own estimate, without checks
  double restart_time_ = 0.0;  // fixed steps count from here
  std::uint64_t fixed_steps_ = 0;
};

}  // namespace variator_sim
