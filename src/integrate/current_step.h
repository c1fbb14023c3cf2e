/// The step that is being made, and what all of its parts share.
#pragma once

#include <cmath>

#include "dynamics/system.h"
#include "integrate/row_watch.h"
#include "integrate/step_checks.h"
#include "integrate/stepper_choice.h"
#include "motion/progress.h"
#include "motion/time_origin.h"

namespace variator_sim {

/// Steps from `time` are longer than this, s. [loop]
inline double shortestStep(double time) {
  return resolutionOf(time);
}

/// How the motion goes on from the start of the step.
enum class StepPhase {
  kStepping,  ///< to its end, by the stepper
  kCrossing   ///< to its end, over an event, by a series
};

/// All are [loop].
struct CurrentStep {
  /// Both have to outlive this.
  CurrentStep(System& its_system, const Scene& scene);

  double absolute(double t) const { return origin.absolute(t); }
  double relative(double time) const { return origin.relative(time); }
  /// The state of a node whose derivative is known.
  StateView viewOf(const StepNode& node);
  /// x at a short time after a node, by Taylor's series from what is known there.
  State extrapolate(const StepNode& from, double length) const;

  /// Evaluates x' at the end. False when it is not finite.
  bool differentiateEnd();
  /// Reads what the last derivative, taken at the end, tells beside x': Q', C, and whether it lies
  /// in a corner of psi.
  void noteDerivative();
  /// Checks Q' and C at the end. False when it is no good: then either the motion has stopped or
  /// the step is to be repeated shorter.
  bool checkEnd();
  /// Checks the rows of C at the end. False when it is no good; where one has vanished the motion
  /// has stopped.
  bool noteRows();

  /// Stops the motion at the end of the step.
  void stop(StopReason reason);
  /// Stops it where neither branch of `guard` goes on.
  void stopChattering(int guard);
  /// Stops it where no step however short succeeds, and finds out why (diagnosis.h); `otherwise` is
  /// the reason where nothing more is found.
  void explainStop(StopReason otherwise = StopReason::kStepUnderflow);

  const int S;  // shafts
  const bool integrates_torque;
  const SolverSettings& settings;
  System& system;
  Drivetrain& drivetrain;  // the system's
  const Tolerance tolerance;
  StepperChoice choice;
  Stepper* stepper;  ///< that makes this step
  StepChecks checks;
  RowWatch rows;
  Progress progress;
  TimeOrigin origin;  ///< times of nodes are counted from there
  MotionStatus status;
  Statistics statistics;

  StepPhase phase = StepPhase::kStepping;
  StepNode start;             ///< t_n
  StepNode end;               ///< t_{n+1}
  double next_length = 0.0;   ///< of the step after this one, s
  bool is_at_start = true;    ///< of the motion: nothing has moved yet
  bool is_in_corner = false;  ///< of psi: the end
};

/// A part of the integrator: it works on the current step.
class StepPart {
 protected:
  explicit StepPart(CurrentStep& step)
      : S(step.S),
        integrates_torque_(step.integrates_torque),
        step_(step),
        system_(step.system),
        drivetrain_(step.drivetrain),
        tolerance_(step.tolerance),
        start_(step.start),
        end_(step.end) {}

  const int S;  // shafts
  const bool integrates_torque_;
  CurrentStep& step_;
  System& system_;
  Drivetrain& drivetrain_;
  const Tolerance& tolerance_;
  StepNode& start_;
  StepNode& end_;
};

}  // namespace variator_sim
