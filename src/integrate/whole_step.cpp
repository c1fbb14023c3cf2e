// A step as the motion's series make it in one (dynamics/series_step.inc): what is asked of it, and
// what it leaves.
#include "integrate/integrator.h"

namespace variator_sim {

void Integrator::leaveWholeStep() {
  stepper_->restart();
  front_ = base_;
}

bool Integrator::makeWholeStep() {
  if (!mayMakeWholeSteps()) return false;
  MotionSeries& series = *system_.series();
  const bool goes_on = series.isNextBegunAt(base_.time);
  if (!goes_on) series.keepReaction(system_.keptReaction());
  const double segment_end = endOfReach();
  const bool is_in_reach = segment_end - base_.time <= settings_.maximum_step;
  const double limit = is_in_reach ? segment_end - base_.time : settings_.maximum_step;
  const double limit_end = is_in_reach ? segment_end : base_.time + limit;
  if (!(limit > shortestStep(base_.time))) return false;
  const SeriesStep* const made = stepper_->makeWholeStep(base_, goes_on, limit, limit_end);
  if (made == nullptr) return false;
  if (!(made->taken > shortestStep(base_.time))) {
    leaveWholeStep();
    return false;
  }
  front_.time = made->end;
  front_.x.assign(made->x_new);
  for (int n = 0; n < 2 * S; ++n) front_.dxdt[n] = front_.x[n + S];
  for (int i = 0; i < S; ++i) {
    front_.dxdt[2 * S + i] = made->eta[i];
    front_.torque[i] = series.nextTorque(i)[0];
    front_.torque_rate[i] = series.nextTorque(i)[1] / made->next_unit;
  }
  if (!drivetrain_.inertia().isConstant()) system_.view(front_.time, front_.x);
  course_ = Course::kStep;
  is_in_corner_ = false;
  checks_.noteTorqueSize(base_);
  rows_.lookAt(made->C, made->row_length);
  if (!rows_.noteStraight()) {
    leaveWholeStep();
    return false;
  }
  if (made->moved > kMoved) {
    State rounding(system_.size());
    noteRounding(calcRounding(front_.time, front_.x, rounding));
  }
  drivetrain_.countRightHandSide();
  ++statistics_.steps;
  statistics_.projections += static_cast<std::uint64_t>(made->projections);
  next_step_ = made->length;
  lookAhead();
  return true;
}

}  // namespace variator_sim
