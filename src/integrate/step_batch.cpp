#include "integrate/step_batch.h"

namespace variator_sim {

int StepBatch::makeAhead(double target, const SeriesNode** nodes) {
  if (!isPossible()) return 0;
  MotionSeries& series = *system_.series();
  const bool goes_on = series.isNextBegunAt(start_.time);
  if (!goes_on) series.keepReaction(system_.reaction().kept());
  const bool watches_rest = !drivetrain_.readsTime() && step_.settings.sleep;
  const Reach reach{step_.relative(target), size_.endOfReach(), step_.settings.maximum_step,
                    step_.choice.stepsUnseen(), watches_rest};
  if (!(reach.longestFrom(start_.time) > shortestStep(start_.time))) return 0;
  const SeriesStep* made = nullptr;
  const int count = step_.stepper->makeWholeSteps(start_, goes_on, reach, &made);
  if (count > 0) *nodes = made->node;
  return count;
}

bool StepBatch::take(double from, const SeriesNode& to) {
  // A step that was moved by more than this, in tolerances, may have been so by rounding.
  constexpr double kMoved = 0.5;
  if (!(to.taken > shortestStep(from)) || !step_.rows.noteStraight(to.C, to.row_length))
    return false;
  if (to.moved > kMoved) {
    if (!drivetrain_.inertia().isConstant()) drivetrain_.setInertia(to.x, to.inertia);
    State x(system_.size());
    x.assign(to.x);
    step_.checks.noteProjectionRounding(to.end, x);
  }
  drivetrain_.countRightHandSide();
  ++step_.statistics.steps;
  step_.statistics.projections += static_cast<std::uint64_t>(to.projections);
  return true;
}

void StepBatch::moveTo(const SeriesNode& made, StepNode* node) const {
  node->time = made.end;
  node->x.assign(made.x);
  for (int n = 0; n < 2 * S; ++n) node->dxdt[n] = made.x[n + S];
  for (int i = 0; i < S; ++i) {
    node->dxdt[2 * S + i] = made.eta[i];
    node->torque[i] = made.torque[i];
    node->torque_rate[i] = made.torque_rate[i];
  }
}

bool StepBatch::make(double target) {
  const SeriesNode* node = nullptr;
  const int count = makeAhead(target, &node);
  if (count == 0) return false;
  if (count > 1) passed_.from = start_;
  passed_.begin = passed_.end = node;
  double from = start_.time;
  step_.checks.noteTorqueSize(start_.torque.data());
  for (int n = 0;; ++n) {
    if (!take(from, *node)) {
      if (n > 0) {
        moveTo(node[-1], &start_);
        step_.next_length = node[-1].length;
      }
      step_.stepper->restart();
      end_ = start_;
      return false;
    }
    from = node->end;
    const bool is_last = n + 1 == count;
    if (is_last || !step_.progress.count(step_.absolute(from))) break;
    // Nothing is about to rest, and the choice does not look yet.
    sleep_.noteMotion();
    step_.choice.noteUnseenStep();
    step_.checks.noteTorqueSize(node->torque);
    passed_.end = ++node;
  }
  if (passed_.end != passed_.begin) moveTo(node[-1], &start_);
  moveTo(*node, &end_);
  if (!drivetrain_.inertia().isConstant()) drivetrain_.setInertia(node->x, node->inertia);
  step_.phase = StepPhase::kStepping;
  step_.is_in_corner = false;
  step_.next_length = node->length;
  return true;
}

}  // namespace variator_sim
