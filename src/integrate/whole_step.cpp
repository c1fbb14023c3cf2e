// Steps as the motion's series make them in one (dynamics/series_step.inc): what is asked of them,
// and what each leaves. Several are made ahead, as far as the present and as nobody has to look at
// the series of one before the next; they are taken one by one.
#include "integrate/integrator.h"

namespace variator_sim {

void Integrator::leaveWholeSteps() {
  ahead_ = nullptr;
  stepper_->restart();
  front_ = base_;
}

bool Integrator::makeStepsAhead(double target) {
  if (!mayMakeWholeSteps()) return false;
  MotionSeries& series = *system_.series();
  const bool goes_on = series.isNextBegunAt(base_.time);
  if (!goes_on) series.keepReaction(system_.keptReaction());
  const bool watches_rest = !drivetrain_.readsTime() && settings_.sleep;
  const Reach reach{target, endOfReach(), settings_.maximum_step, choice_.stepsUnseen(),
                    watches_rest};
  if (!(reach.longestFrom(base_.time) > shortestStep(base_.time))) return false;
  const SeriesStep* made = nullptr;
  const int count = stepper_->makeWholeSteps(base_, goes_on, reach, &made);
  if (count == 0) return false;
  ahead_ = made->node;
  ahead_end_ = made->node + count;
  return true;
}

bool Integrator::makeWholeStep(double target) {
  if (ahead_ == nullptr && !makeStepsAhead(target)) return false;
  const SeriesNode& made = *ahead_;
  if (++ahead_ == ahead_end_) ahead_ = nullptr;
  if (!(made.taken > shortestStep(base_.time))) {
    leaveWholeSteps();
    return false;
  }
  front_.time = made.end;
  front_.x.assign(made.x);
  for (int n = 0; n < 2 * S; ++n) front_.dxdt[n] = made.x[n + S];
  for (int i = 0; i < S; ++i) {
    front_.dxdt[2 * S + i] = made.eta[i];
    front_.torque[i] = made.torque[i];
    front_.torque_rate[i] = made.torque_rate[i];
  }
  if (!drivetrain_.inertia().isConstant()) drivetrain_.setInertia(made.x, made.inertia);
  course_ = Course::kStep;
  is_in_corner_ = false;
  checks_.noteTorqueSize(base_);
  if (!rows_.noteStraight(made.C, made.row_length)) {
    leaveWholeSteps();
    return false;
  }
  if (made.moved > kMoved) {
    State rounding(system_.size());
    noteRounding(calcRounding(front_.time, front_.x, rounding));
  }
  drivetrain_.countRightHandSide();
  ++statistics_.steps;
  statistics_.projections += static_cast<std::uint64_t>(made.projections);
  next_step_ = made.length;
  if (ahead_ != nullptr) {
    // Nothing is about to rest, and nobody looks.
    rest_.noteMotion();
    choice_.noteUnseenStep();
  } else {
    lookAhead();
  }
  return true;
}

}  // namespace variator_sim
