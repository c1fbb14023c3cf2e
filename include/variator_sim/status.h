/// The status of a motion: running, or stopped for a reason.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace variator_sim {

enum class StopReason : std::uint8_t {
  kNone,                ///< the motion is running
  kSingularConstraint,  ///< C has lost rank: the principle no longer determines the jerk
  kStepUnderflow,       ///< the step fell below the resolution of time
  kNonFiniteValue,      ///< a torque or a constraint gave NaN or infinity
  kStepTooLarge,        ///< the estimated error of one fixed step is a large part of the state
  kToleranceTooSmall,   ///< rounding of the state alone moves the accelerations by more
  kStepLimit,           ///< more steps than `solver/maximum_steps` within one simulated second
  kJumpFailed,          ///< no state on the constraint is reached by a jump of the inputs
  kProjectionFailed,    ///< Newton's iteration onto the constraint did not converge
  kChattering,          ///< a law jumps and the motion crosses back at once
  kTimeExhausted,       ///< the node's simulated time, in whole nanoseconds, is exhausted
  kNoModes,             ///< no modes of the elements that hold go on: rigid ones contradict
  kIndefiniteInertia    ///< J, by formulas, is not positive definite here or just ahead
};

/// Returns the name that users see: "SingularConstraint", "StepUnderflow", ...; "" for kNone.
const char* toString(StopReason reason);

/// Status of the stepping loop: plain data, no allocation.
struct MotionStatus {
  StopReason reason = StopReason::kNone;
  double time = 0.0;     ///< time of the last accepted state, s
  int constraint = -1;   ///< index of the constraint at fault, or -1
  int torque = -1;       ///< index of the torque element at fault, or -1
  double measure = 0.0;  ///< kSingularConstraint: the remaining rank, relative to its scale;
                         ///< kStepTooLarge: the step's estimated error, relative to the state;
                         ///< kToleranceTooSmall: effect of rounding, in tolerances;
                         ///< kStepLimit: the steps of one second at the pace of the last ones;
                         ///< kStepUnderflow: the largest rate of a state's component, relative to
                         ///< its size, 1/s
  bool ok() const { return reason == StopReason::kNone; }
};

/// A change of the mode (HeldElement) of an element that holds, or an event of the scene: then the
/// sides of its function, and no torque.
struct ModeEvent {
  double time = 0.0;  ///< s
  int element = 0;    ///< index in Scene::eventNames
  int from = 0;
  int to = 0;
  double torque = 0.0;   ///< N m, behind it
  double impulse = 0.0;  ///< N m s, of an impact
};
/// Returns "backward", "stuck", "forward", "free"; of events "below", "above".
const char* modeName(int mode);

/// Tells whether the reactions are a considerable source or sink of energy: under
/// `generalized_gauss` they may be once C has turned. Judged at step ends and estimated from these,
/// unless energy is tracked.
struct EnergyDoubt {
  double since = -1.0;      ///< s, when `isShareLarge` first held; below 0: never
  double time = 0.0;        ///< s, time of the values below
  double reactions = 0.0;   ///< work of the reactions since the start, J
  double throughput = 0.0;  ///< integral of sum |Q_i omega_i|, the work that the applied torques
                            ///< have brought and taken, J
  bool isShareLarge() const { return std::abs(reactions) > 0.05 * throughput; }
  bool exists() const { return since >= 0.0 && isShareLarge(); }
};

/// Describes the doubt and a remedy in a sentence; "" when there is none.
std::string describe(const EnergyDoubt& doubt);

/// Times, s, from which estimates of global errors are unreliable, as the samples taken have shown;
/// below 0: never.
struct ErrorDoubt {
  double stopped = -1.0;                  ///< the second motion stopped: no estimate from here on
  StopReason reason = StopReason::kNone;  ///< why
  double grown = -1.0;  ///< an estimate is above 1e8 tolerances or a tenth of its column: errors no
                        ///< longer grow in proportion
  double parted = -1.0;    ///< the laws of both motions have jumped a different number of times
  double rounding = -1.0;  ///< the first sample that was at rounding in every column
  std::uint64_t rounding_samples = 0;  ///< number of samples at rounding
  std::uint64_t samples = 0;           ///< number of all samples
};

/// Describes the doubts as sentences; none when there are none.
std::vector<std::string> describe(const ErrorDoubt& doubt);

/// Counters since the start or the last reset.
struct Statistics {
  std::uint64_t mode_changes = 0;       ///< of elements that hold, and events of the scene
  std::uint64_t steps = 0;              ///< accepted steps
  std::uint64_t rejected_steps = 0;     ///< steps repeated because of their error
  std::uint64_t right_hand_sides = 0;   ///< evaluations of the jerk
  std::uint64_t projections = 0;        ///< Newton iterations onto psi = 0
  std::uint64_t newton_iterations = 0;  ///< for accelerations of least reaction, nonlinear psi
  std::uint64_t implicit_steps = 0;     ///< of the accepted steps, those by an implicit stepper
  std::uint64_t stepper_switches = 0;   ///< changes of stepper by `auto`
  std::uint64_t kinks = 0;              ///< steps that ended where a law has a kink
  std::uint64_t sleeps = 0;             ///< times that the motion came to equilibrium
  double largest_error_estimate = 0.0;  ///< of fixed steps, in units of the tolerance
  double largest_rounding = 0.0;        ///< effect of rounding of the time and the state on a
                                        ///< step's end beyond its tolerance, in tolerances
  std::uint64_t jumps = 0;              ///< instants at which inputs jumped
  std::uint64_t commands_accepted = 0;
  std::uint64_t commands_clamped = 0;  ///< accepted after clamping to [min, max]
  std::uint64_t commands_refused = 0;  ///< NaN or infinite, or rejected on their way
  std::uint64_t command_timeouts = 0;
};

}  // namespace variator_sim
