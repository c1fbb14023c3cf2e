/// The motion inside the last step: states, samples, and what goes on from there.
#pragma once

#include "integrate/current_step.h"
#include "integrate/guard_search.h"

namespace variator_sim {

/// All are [loop].
class InsideStep : private StepPart {
 public:
  InsideStep(CurrentStep& step, const GuardSearch& guards) : StepPart(step), guards_(guards) {}

  /// True when `now` lies within the last step, and not at its end.
  bool contains(double now) const { return start_.time < end_.time && now != end_.time; }
  /// x at `now`, by dense output where the stepper has it. False where the motion stopped. `now`
  /// becomes the instant just behind an event where it lies on one: x and laws are of one side.
  bool calcState(double* now, State& x);
  /// Steps from the start to `now`, which lies inside the last step, to the full order and with the
  /// full error control: what the motion continues from after a command. False, and the motion
  /// stopped, in the odd case that no step however short succeeds.
  bool reach(double now, StepNode* node);
  /// x at start + theta (end - start): within about the tolerance, not projected, and without a
  /// word in the status.
  void calcPart(double theta, State& x);

 private:
  /// x at `now` of a motion that is not stepped there, see calcState. False where it is.
  bool calcUnstepped(double* now, State& x);
  /// x at `now` by dense output, projected. False where there is none.
  bool interpolate(double now, State& x);
  /// True where the defect of a collocation polynomial p shows that accelerations, which follow
  /// from the state, are within the tolerance at p(now) = x, where `slope` is p'. With the error
  /// e = p - x and the defect d = p' - x'(p): e' = x'_x e + d, so that x'_x e, the error of the
  /// accelerations, is at most about d, be the motion stiff or not. d is zero at the stages and,
  /// with the product of (theta - c_i), largest at theta = 0, where it needs no evaluation.
  bool followsMotion(double now, const State& slope, const State& x);

  /// The defect at theta = 0 over its largest value between stages: 2.67 of three, 2.51 of seven.
  static constexpr double kLargerAtStart = 2.5;

  const GuardSearch& guards_;
};

}  // namespace variator_sim
