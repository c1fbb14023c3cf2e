#include "integrate/event_handler.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

void EventHandler::enclose(double taken, StateBox* box) const {
  const auto ends = [this](const StepNode& node) -> CurveEnd {
    const double* x = node.x.data();
    const double* last = node.dxdt.data() + node.dxdt.size() - S;
    if (integrates_torque_) return {x, x + S, x + 2 * S, last};
    return {x, x + S, last, nullptr};
  };
  encloseStep(S, ends(start_), ends(end_), taken, box);
}

EventHandler::Finding EventHandler::locate(double taken, double* next) {
  // Both ends alone exclude an event most often.
  StateBox box;
  enclose(taken, &box);
  box.time = {step_.absolute(start_.time), step_.absolute(end_.time)};
  guards_.ignoreNone();
  is_still_ = isStill(box);
  if (endsOnEvent(taken)) return stopShort(taken, next);
  if (guards_.isClear(box)) return keepNext();
  traceStep(taken);
  return approach(taken, next);
}

bool EventHandler::isStill(const StateBox& box) const {
  const auto moves = [this](const Interval& range) {
    return !(range.high - range.low <= tolerance_.of(range.low, range.high));
  };
  for (int i = 0; i < S; ++i) {
    if (moves(box.angle[i]) || moves(box.velocity[i]) || moves(box.acceleration[i])) return false;
  }
  return true;
}

bool EventHandler::isHarmless(int guard, const StateView& beyond) {
  if (!is_still_ || guards_.guard(guard).readsTime() || drivetrain_.guardOwner(guard).torque < 0) {
    return false;
  }
  double before[kMaxShafts];
  double behind[kMaxShafts];
  const StateView here = step_.viewOf(start_);
  drivetrain_.calcTorque(here, before);
  drivetrain_.calcTorque(beyond, behind);
  for (int i = 0; i < S; ++i) {
    const double allowed = drivetrain_.inertia().entry(i, i) * tolerance_.of(here.acceleration[i]);
    if (!(std::abs(behind[i] - before[i]) <= allowed)) return false;
  }
  return true;
}

bool EventHandler::isEventOfTime(double taken) {
  if (!integrates_torque_) return false;
  StateBox box;
  enclose(taken, &box);
  box.time = {step_.absolute(start_.time), step_.absolute(start_.time)};
  return guards_.isClear(box);
}

bool EventHandler::endsOnEvent(double taken) {
  for (int i = 0; i < guards_.count(); ++i) {
    const int side = guards_.side(i);
    if (side == Guard::kOnEdge || guards_.guard(i).branch(step_.viewOf(end_)) != Guard::kOnEdge) {
      continue;
    }
    // A motion that comes to rest on an edge does not go beyond it.
    StepNode beyond = end_;
    const double ahead = kMargin * taken;
    beyond.time += ahead;
    for (int n = 0; n < beyond.x.size(); ++n) beyond.x[n] += ahead * end_.dxdt[n];
    const int branch = guards_.guard(i).branch(step_.viewOf(beyond));
    if (branch == Guard::kOnEdge || branch == side || isHarmless(i, step_.viewOf(beyond))) continue;
    crossing_.next().guard = i;
    crossing_.next().side = side;
    return true;
  }
  return false;
}

EventHandler::Finding EventHandler::stopShort(double taken, double* next) {
  const double margin = kMargin * taken + 2.0 * shortestStep(step_.absolute(start_.time));
  *next = taken - margin;
  crossing_.next().at = start_.time + *next;
  crossing_.next().length = 2.0 * margin;
  return Finding::kShorter;
}

EventHandler::Finding EventHandler::locateByEnd(double taken, double* next) {
  if (!end_.x.isFinite()) return Finding::kClear;
  system_(end_.x, end_.dxdt, end_.time);
  guards_.ignoreNone();
  is_still_ = false;
  if (endsOnEvent(taken)) return stopShort(taken, next);
  if (!guards_.hasAnyLeft(step_.viewOf(end_))) return Finding::kClear;
  traceEnds(taken);
  const double rejected = *next;
  const Finding finding = approach(taken, next);
  if (finding != Finding::kShorter || *next <= 0.9 * taken) {
    crossing_.next().is_guess = finding == Finding::kShorter;
    return finding;
  }
  *next = rejected;
  return Finding::kClear;
}

void EventHandler::traceEnds(double taken) {
  curve_.begin(step_.absolute(start_.time), taken, S, integrates_torque_);
  for (int n = 0; n < StepCurve::kNodes; ++n) {
    const double part = StepCurve::node(n);
    const double rest = 1.0 - part;
    State x(system_.size());
    for (int m = 0; m < x.size(); ++m) {
      const double change = end_.x[m] - start_.x[m];
      const double bend =
          rest * (taken * start_.dxdt[m] - change) - part * (taken * end_.dxdt[m] - change);
      x[m] = start_.x[m] + part * (change + rest * bend);
    }
    curve_.setNode(n, x.data());
  }
  curve_.finish();
}

EventHandler::Finding EventHandler::approach(double taken, double* next) {
  const double shortest = 2.0 * shortestStep(step_.absolute(start_.time));
  const double resolution = std::max(kResolution, shortest / taken);
  GuardFinding finding = guards_.find(curve_, resolution);
  while (finding.kind == GuardFinding::Kind::kCrossing &&
         isHarmless(finding.guard, guards_.at(curve_, finding.beyond))) {
    guards_.ignore(finding.guard);
    finding = guards_.find(curve_, resolution);
  }
  if (finding.kind == GuardFinding::Kind::kClear) return keepNext();
  crossing_.next() = NextEvent{};
  if (finding.kind == GuardFinding::Kind::kUnknown) {
    *next = taken * std::max(finding.clear, 0.1);
    return Finding::kShorter;
  }
  // The step ends a little before the event, for no stage to lie behind it.
  const double margin = kMargin * taken + shortest;
  crossing_.next().guard = finding.guard;
  crossing_.next().side = guards_.side(finding.guard);
  crossing_.next().length = (finding.beyond - finding.clear) * taken + margin + shortest;
  *next = finding.clear * taken - margin;
  // An event that was due here and was not there: the curve that shows it again errs by more than
  // the event's argument.
  constexpr double kAnew = 1e-3;  // of the step
  const bool is_anew = crossing_.wasAbsent(finding.guard) && finding.clear < kAnew;
  if (!is_anew) {
    if (*next > margin) {
      crossing_.next().at = start_.time + *next;
      return Finding::kShorter;
    }
    crossing_.next().at = start_.time;
    crossing_.next().length += *next;
    if (crossing_.cross()) return Finding::kCrossed;
  }
  // It is not there: the curve of so long a step is no good.
  crossing_.next() = NextEvent{};
  *next = 0.25 * taken;
  return Finding::kShorter;
}

EventHandler::Finding EventHandler::keepNext() {
  if (!crossing_.next().isDueAt(end_.time)) crossing_.next() = NextEvent{};
  return Finding::kClear;
}

void EventHandler::traceStep(double taken) {
  curve_.begin(step_.absolute(start_.time), taken, S, integrates_torque_);
  for (int n = 0; n < StepCurve::kNodes; ++n) {
    const double time = start_.time + StepCurve::node(n) * taken;
    State x(system_.size());
    if (n == 0) {
      x = start_.x;
    } else if (n + 1 == StepCurve::kNodes) {
      x = end_.x;
    } else if (!step_.stepper->interpolate(system_, time, start_, end_, x)) {
      step_.choice.innerOf(*step_.stepper).step(system_, start_, time - start_.time, x);
    }
    curve_.setNode(n, x.data());
  }
  curve_.finish();
}

bool EventHandler::begin() {
  crossing_.updateBranches();
  findEventAtStart();
  return !step_.is_at_start || leaveCorner();
}

void EventHandler::findEventAtStart() {
  for (int i = 0; i < guards_.count(); ++i) {
    if (!guards_.guard(i).jumps()) continue;
    if (guards_.side(i) != Guard::kOnEdge && !guards_.isNear(i, step_.viewOf(end_), S)) continue;
    crossing_.next().guard = i;
    crossing_.next().side = Guard::kOnEdge;
    crossing_.next().at = end_.time;
    crossing_.next().length =
        2.0 * shortestStep(std::max(1.0, std::abs(step_.absolute(end_.time))));
    return;
  }
}

bool EventHandler::leaveCorner() {
  // Relative to the accelerations: so near to a corner a start lies in it.
  constexpr double kCorner = 1e-11;
  if (!integrates_torque_) return true;
  for (const Constraint* kink : drivetrain_.kinks()) {
    double G[kMaxShafts];
    const StateView state = step_.viewOf(end_);
    const double g = kink->calcResidualAndJacobian(state, G);
    double size = 0.0;
    for (int i = 0; i < S; ++i) size += std::abs(G[i]) * (1.0 + std::abs(state.acceleration[i]));
    if (!(std::abs(g) <= kCorner * size)) continue;
    const bool is_still = std::all_of(end_.dxdt.begin() + 2 * S, end_.dxdt.end(),
                                      [](double jerk) { return jerk == 0.0; });
    if (!is_still && !leaveKink(*kink, G, 10.0 * kCorner * size)) return false;
  }
  return true;
}

bool EventHandler::leaveKink(const Constraint& kink, const double* G, double distance) {
  int leading = 0;
  StepNode best = end_;
  for (const double side : {1.0, -1.0}) {
    StepNode beside = end_;
    if (moveAside(kink, G, side * distance, beside)) {
      best = beside;
      ++leading;
    }
  }
  if (leading == 1) {
    end_ = best;
    start_ = end_;
    crossing_.updateBranches();
    return true;
  }
  step_.stop(StopReason::kChattering);
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    for (const ConstraintPtr& own : drivetrain_.constraint(m).kinks()) {
      if (own.get() == &kink) step_.status.constraint = m;
    }
  }
  return false;
}

bool EventHandler::moveAside(const Constraint& kink, const double* G, double distance,
                             StepNode& node) {
  double direction[kMaxShafts];
  drivetrain_.inertia().solve(G, direction);
  double slope = 0.0;
  for (int i = 0; i < S; ++i) slope += G[i] * direction[i];
  if (!(slope > 0.0)) return false;
  double* acceleration = node.x.data() + node.x.size() - S;
  for (int i = 0; i < S; ++i) acceleration[i] += distance / slope * direction[i];
  State moved(system_.size());
  if (system_.project(node.time, node.x, moved, &step_.statistics.projections) !=
      ProjectionResult::kConverged) {
    return false;
  }
  system_(node.x, node.dxdt, node.time);
  double row[kMaxShafts];
  double rate;
  const StateView state = step_.viewOf(node);
  if (!(kink.calcResidual(state) * distance > 0.0)) return false;
  kink.calcRow(state, row, &rate);
  for (int i = 0; i < S; ++i) rate += row[i] * node.dxdt[node.dxdt.size() - S + i];
  return rate * distance > 0.0;
}

}  // namespace variator_sim
