#include "integrate/inside_step.h"

#include <cmath>

namespace variator_sim {

bool InsideStep::calcUnstepped(double* now, State& x) {
  bool is_near = true;
  switch (step_.phase) {
    case StepPhase::kStepping:
      return false;
    case StepPhase::kCrossing:
      x = step_.extrapolate(start_, *now - start_.time);
      // If the laws are at the event or behind it, so are the state and its time: no torque of one
      // side stands beside accelerations of the other. (Far along an edge rounding chooses it.)
      for (int n = 0; n < 2 * S; ++n) {
        is_near = is_near && std::abs(x[n] - end_.x[n]) <= tolerance_.of(end_.x[n]);
      }
      if (*now == end_.time || (is_near && !guards_.hasAnyLeft(system_.view(*now, x)))) {
        x = end_.x;
        *now = end_.time;
      }
      return true;
  }
  return false;
}

bool InsideStep::calcState(double* at, State& x) {
  if (calcUnstepped(at, x)) return true;
  const double now = *at;
  x = end_.x;
  if (!(start_.time < end_.time)) *at = end_.time;
  if (!contains(now)) return true;
  if (interpolate(now, x)) return true;
  StepNode node(system_);
  const bool is_reached = reach(now, &node);
  x = is_reached ? node.x : start_.x;
  return is_reached;
}

bool InsideStep::interpolate(double now, State& x) {
  const bool is_implicit = step_.stepper->isImplicit();
  if (!integrates_torque_ && !step_.stepper->stepsBySeries() && !is_implicit) return false;
  if (!step_.stepper->interpolate(system_, now, start_, end_, x)) return false;
  State moved(system_.size());
  State slope(system_.size());
  const double h = end_.time - start_.time;
  if (is_implicit) step_.stepper->calcSlope((now - start_.time) / h, h, slope);
  const ProjectionResult result =
      is_implicit ? system_.projectStiffly(now, h, slope, x, moved, &step_.statistics.projections)
                  : system_.project(now, x, moved, &step_.statistics.projections);
  if (result != ProjectionResult::kConverged) return false;
  return integrates_torque_ || !is_implicit || followsMotion(now, slope, x);
}

bool InsideStep::followsMotion(double now, const State& slope, const State& x) {
  State first(system_.size());
  State rate(system_.size());
  step_.stepper->calcSlope(0.0, end_.time - start_.time, first);
  system_(x, rate, now);
  for (int n = S; n < x.size(); ++n) {
    const double allowed = tolerance_.of(rate[n]);
    if (!(std::abs(first[n] - start_.dxdt[n]) <= kLargerAtStart * allowed)) return false;
    if (!(std::abs(slope[n] - rate[n]) <= allowed)) return false;
  }
  return true;
}

bool InsideStep::reach(double now, StepNode* node) {
  *node = start_;
  node->time = now;
  if (calcUnstepped(&node->time, node->x)) return true;
  node->time = start_.time;
  Stepper& stepper = step_.choice.innerOf(*step_.stepper);
  stepper.restart();  // what was asked for before is to change no bit of this
  double h = now - start_.time;
  int steps = 0;
  while (now - node->time > shortestStep(now)) {
    if (++steps > step_.settings.maximum_steps) {
      step_.stop(StopReason::kStepLimit);
      step_.status.time = step_.absolute(node->time);
      return false;
    }
    const bool last = node->time + h >= now;
    const double end = last ? now : node->time + h;
    const StepNode start = *node;
    if (!(end > start.time)) {
      start_ = end_ = start;
      step_.explainStop();
      return false;
    }
    double norm = step_.checks.stepAndProject(stepper, start, end, end - start.time, node->x);
    if (norm <= 1.0) {
      norm = worseOf(norm, step_.checks.checkAccelerations(stepper, start, end, node->x));
    }
    if (step_.checks.isGood(norm)) {
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

void InsideStep::calcPart(double theta, State& x) {
  const double h = end_.time - start_.time;
  if (step_.phase != StepPhase::kCrossing) {
    if (step_.stepper->interpolate(system_, start_.time + theta * h, start_, end_, x)) return;
    // A step that was good is so for a part of it.
    if (std::isfinite(step_.choice.innerOf(*step_.stepper).step(system_, start_, theta * h, x)))
      return;
  }
  for (int n = 0; n < x.size(); ++n) {
    x[n] = start_.x[n] + theta * (end_.x[n] - start_.x[n]);
  }
}

}  // namespace variator_sim
