// Steps as the motion's series make them in one (dynamics/series_step.inc): what is asked of them,
// and what each leaves. Several are made ahead, as far as the present and as nobody has to look at
// the series of one before the next. All but the last of them are passed over: of these only what
// adds up is kept.
#include "integrate/integrator.h"

namespace variator_sim {

void Integrator::leaveWholeSteps() {
  stepper_->restart();
  front_ = base_;
}

int Integrator::makeStepsAhead(double target, const SeriesNode** nodes) {
  if (!mayMakeWholeSteps()) return 0;
  MotionSeries& series = *system_.series();
  const bool goes_on = series.isNextBegunAt(base_.time);
  if (!goes_on) series.keepReaction(system_.keptReaction());
  const bool watches_rest = !drivetrain_.readsTime() && settings_.sleep;
  const Reach reach{relative(target), endOfReach(), settings_.maximum_step, choice_.stepsUnseen(),
                    watches_rest};
  if (!(reach.longestFrom(base_.time) > shortestStep(base_.time))) return 0;
  const SeriesStep* made = nullptr;
  const int count = stepper_->makeWholeSteps(base_, goes_on, reach, &made);
  if (count > 0) *nodes = made->node;
  return count;
}

bool Integrator::takeWholeStep(double from, const SeriesNode& to) {
  if (!(to.taken > shortestStep(from)) || !rows_.noteStraight(to.C, to.row_length)) return false;
  if (to.moved > kMoved) {
    if (!drivetrain_.inertia().isConstant()) drivetrain_.setInertia(to.x, to.inertia);
    State x(system_.size());
    State rounding(system_.size());
    x.assign(to.x);
    noteRounding(calcRounding(to.end, x, rounding));
  }
  drivetrain_.countRightHandSide();
  ++statistics_.steps;
  statistics_.projections += static_cast<std::uint64_t>(to.projections);
  return true;
}

void Integrator::moveTo(const SeriesNode& made, StepNode* node) const {
  node->time = made.end;
  node->x.assign(made.x);
  for (int n = 0; n < 2 * S; ++n) node->dxdt[n] = made.x[n + S];
  for (int i = 0; i < S; ++i) {
    node->dxdt[2 * S + i] = made.eta[i];
    node->torque[i] = made.torque[i];
    node->torque_rate[i] = made.torque_rate[i];
  }
}

bool Integrator::makeWholeStep(double target) {
  const SeriesNode* node = nullptr;
  const int count = makeStepsAhead(target, &node);
  if (count == 0) return false;
  if (count > 1) passed_.from = base_;
  passed_.begin = passed_.end = node;
  double from = base_.time;
  checks_.noteTorqueSize(base_.torque.data());
  for (int n = 0;; ++n) {
    if (!takeWholeStep(from, *node)) {
      if (n > 0) {
        moveTo(node[-1], &base_);
        next_step_ = node[-1].length;
      }
      leaveWholeSteps();
      return false;
    }
    from = node->end;
    const bool is_last = n + 1 == count;
    if (is_last || !progress_.count(absolute(from))) break;
    // Nothing is about to rest, and nobody looks.
    rest_.noteMotion();
    choice_.noteUnseenStep();
    checks_.noteTorqueSize(node->torque);
    passed_.end = ++node;
  }
  if (passed_.end != passed_.begin) moveTo(node[-1], &base_);
  moveTo(*node, &front_);
  if (!drivetrain_.inertia().isConstant()) drivetrain_.setInertia(node->x, node->inertia);
  course_ = Course::kStep;
  is_in_corner_ = false;
  next_step_ = node->length;
  lookAhead();
  return true;
}

}  // namespace variator_sim
