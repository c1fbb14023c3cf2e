/// Detects and localizes events, where a law changes its branch: a step is to end shortly before
/// one.
#pragma once

#include "integrate/event_crossing.h"
#include "integrate/guard_search.h"
#include "integrate/step_curve.h"

namespace variator_sim {

/// All are [loop].
class EventHandler : private StepPart {
 public:
  enum class Finding {
    kClear,    ///< no event inside
    kShorter,  ///< the step is to be made again, shorter
    kCrossed   ///< the event was at the start: the step went across it, and no further
  };

  EventHandler(CurrentStep& step, GuardSearch& guards, EventCrossing& crossing)
      : StepPart(step), guards_(guards), crossing_(crossing) {}

  /// Whether any law leaves its branch within the step of length `taken` from the start to the end,
  /// whose derivative is known. kShorter: it has to be made again with the length `next`, to
  /// shortly before the first event.
  Finding locate(double taken, double* next);
  /// The same for a step whose error was too large: whether it ended beyond an event.
  Finding locateByEnd(double taken, double* next);
  /// Nothing moved by more than its tolerance in the last step that `locate` was asked of.
  bool isStill() const { return is_still_; }
  /// The step meets events by the time alone, and the torque, which is integrated, is compared at
  /// its end: the one behind may be as long as it would have been.
  bool isEventOfTime(double taken);

  /// The motion begins at the end of the step. On the edge of a jump it is to be seen at once which
  /// of both branches it takes. False, and the motion stopped, when it cannot leave a corner.
  bool begin();

 private:
  /// Nothing moves by more than its tolerance from the start to the end.
  bool isStill(const StateBox& box) const;
  /// In such a step the torques behind an event of the state are those before it: rounding decides
  /// the side, and it makes no difference.
  bool isHarmless(int guard, const StateView& beyond);
  /// Encloses the states of the step, but for its time.
  void enclose(double taken, StateBox* box) const;
  /// A step that ends on an event and goes on beyond it is made again, to shortly before it:
  /// standing on it no branch is that of the motion.
  bool endsOnEvent(double taken);
  Finding stopShort(double taken, double* next);
  /// The first event along the curve: crossed where it is at the start, the step to it otherwise.
  Finding approach(double taken, double* next);
  /// An event that was found by a longer step stays the next one only when this one ends there.
  Finding keepNext();
  /// The motion inside the step as polynomials: by the dense output where there is one, and else by
  /// shorter steps from the start.
  void traceStep(double taken);
  /// The same by the cubic through both ends.
  void traceEnds(double taken);

  void findEventAtStart();
  /// A motion that begins in a corner of psi (a zero of abs(e1), say, where the least reaction
  /// often lies): C is another one on each of its sides, and the motion takes the side on which its
  /// own jerk leads away from the corner. False, and the motion stopped, when neither side or
  /// either does.
  bool leaveCorner();
  /// Leaves the corner that `kink`, whose gradient is G, has at the end, by `distance` of its
  /// value.
  bool leaveKink(const Constraint& kink, const double* G, double distance);
  /// Moves the accelerations of a node in a corner to where `kink`, whose gradient is G, has about
  /// the value `distance`, along psi = 0. False where the jerk there leads back into the corner.
  bool moveAside(const Constraint& kink, const double* G, double distance, StepNode& node);

  /// An event is found to within this part of the step (some roundings).
  static constexpr double kResolution = 1e-14;
  /// The step made again ends by this part before it: dense output errs by less.
  static constexpr double kMargin = 1e-7;

  GuardSearch& guards_;
  EventCrossing& crossing_;
  StepCurve curve_;
  bool is_still_ = false;
};

}  // namespace variator_sim
