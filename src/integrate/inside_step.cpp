/// The motion inside the last step: states, samples, and what goes on from there.
#include <cmath>

#include "integrate/integrator.h"

namespace variator_sim {

bool Integrator::calcUnstepped(double* now, State& x) {
  switch (course_) {
    case Course::kStep:
      return false;
    case Course::kHop:
      x = goAhead(base_, *now - base_.time);
      // Where the laws are on the branch behind the edge, or on the edge, so are the state and its
      // time: no torque of one side beside accelerations of the other.
      if (*now == front_.time || !guards_.hasAnyLeft(system_.view(*now, x))) {
        x = front_.x;
        *now = front_.time;
      }
      return true;
    case Course::kRest:
      calcRest(*now, x);
      return true;
  }
  return false;
}

bool Integrator::calcSample(double now, Sample* sample) {
  if (course_ != Course::kStep || !(base_.time < front_.time) || now == front_.time) return false;
  return may_make_whole_steps_ && !drivetrain_.haveInputsMoved() &&
         stepper_->calcSample(now, base_, front_, &statistics_.projections, sample);
}

bool Integrator::calcState(double* at, State& x) {
  if (calcUnstepped(at, x)) return true;
  const double now = *at;
  x = front_.x;
  if (!(base_.time < front_.time)) *at = front_.time;
  if (!(base_.time < front_.time) || now == front_.time) return true;
  // Where accelerations follow from the state, an error of dense output may be large for them.
  if ((integrates_torque_ || stepper_->stepsBySeries()) &&
      stepper_->interpolate(system_, now, base_, front_, x)) {
    State moved(system_.size());
    State slope(system_.size());
    const double h = front_.time - base_.time;
    if (stepper_->isImplicit()) stepper_->calcSlope((now - base_.time) / h, h, slope);
    const ProjectionResult result =
        stepper_->isImplicit()
            ? system_.projectStiffly(now, h, slope, x, moved, &statistics_.projections)
            : system_.project(now, x, moved, &statistics_.projections);
    if (result == ProjectionResult::kConverged) return true;
  }
  StepNode node(system_);
  const bool is_reached = reach(now, &node);
  x = is_reached ? node.x : base_.x;
  return is_reached;
}

bool Integrator::reach(double now, StepNode* node) {
  *node = base_;
  node->time = now;
  if (calcUnstepped(&node->time, node->x)) return true;
  node->time = base_.time;
  Stepper& stepper = choice_.innerOf(*stepper_);
  stepper.restart();  // what was asked for before is to change no bit of this
  double h = now - base_.time;
  int steps = 0;
  while (now - node->time > shortestStep(now)) {
    if (++steps > settings_.maximum_steps) {
      stop(StopReason::kStepLimit);
      status_.time = absolute(node->time);
      return false;
    }
    const bool last = node->time + h >= now;
    const double end = last ? now : node->time + h;
    const StepNode start = *node;
    if (!(end > start.time)) {
      base_ = front_ = start;
      explainStop();
      return false;
    }
    double norm = stepAndProject(stepper, start, end, end - start.time, node->x);
    if (norm <= 1.0) {
      norm = worseOf(norm, checks_.checkAccelerations(stepper, start, end, node->x));
    }
    if (isGood(norm)) {
      node->time = end;
      if (!last) system_(node->x, node->dxdt, end);
      h *= 2.0;
    } else {
      *node = start;
      h = 0.5 * (end - start.time);  // rare: a shorter step is nearly always better
    }
  }
  node->time = now;
  return true;
}

void Integrator::calcInside(double theta, State& x) {
  const double h = front_.time - base_.time;
  if (course_ != Course::kHop) {
    if (stepper_->interpolate(system_, base_.time + theta * h, base_, front_, x)) return;
    // A step that was good is so for a part of it.
    if (std::isfinite(choice_.innerOf(*stepper_).step(system_, base_, theta * h, x))) return;
  }
  for (int n = 0; n < x.size(); ++n) {
    x[n] = base_.x[n] + theta * (front_.x[n] - base_.x[n]);
  }
}

}  // namespace variator_sim
