#include <algorithm>
#include <cmath>

#include "integrate/integrator.h"

namespace variator_sim {

void Integrator::moveGuards() {
  const StateView state = viewOf(front_);
  guards_.moveBase(state);
  if (!is_in_corner_) return;
  for (int i = 0; i < guards_.count(); ++i) {
    if (drivetrain_.guardOwner(i).constraint >= 0) guards_.muteOnEdge(i, state, S);
  }
}

StateView Integrator::viewOf(const StepNode& node) {
  const double* acceleration =
      integrates_torque_ ? node.x.data() + node.x.size() - S : node.dxdt.data() + S;
  return drivetrain_.view(node.time, node.x.data(), node.x.data() + S, acceleration);
}

CurveEnd Integrator::curveEnd(const StepNode& node) const {
  const double* x = node.x.data();
  const double* last = node.dxdt.data() + node.dxdt.size() - S;
  if (integrates_torque_) return {x, x + S, x + 2 * S, last};
  return {x, x + S, last, nullptr};
}

Integrator::Look Integrator::lookInside(double taken, double* next) {
  // What both ends tell excludes it most often.
  StateBox box;
  encloseStep(S, curveEnd(base_), curveEnd(front_), taken, &box);
  box.time = {absolute(base_.time), absolute(front_.time)};
  if (endsOnEdge(taken)) return shortOfEnd(taken, next);
  if (guards_.isClear(box)) return keepCrossing();
  traceStep(taken);
  return aimAtEdge(taken, next);
}

bool Integrator::isEdgeOfTime(double taken) {
  if (!integrates_torque_) return false;
  StateBox box;
  encloseStep(S, curveEnd(base_), curveEnd(front_), taken, &box);
  box.time = {absolute(base_.time), absolute(base_.time)};
  return guards_.isClear(box);
}

bool Integrator::endsOnEdge(double taken) {
  for (int i = 0; i < guards_.count(); ++i) {
    const int side = guards_.side(i);
    if (side == Guard::kOnEdge || guards_.guard(i).branch(viewOf(front_)) != Guard::kOnEdge) {
      continue;
    }
    // A motion that comes to rest on an edge does not go beyond it.
    StepNode beyond = front_;
    const double ahead = kMargin * taken;
    beyond.time += ahead;
    for (int n = 0; n < beyond.x.size(); ++n) beyond.x[n] += ahead * front_.dxdt[n];
    const int branch = guards_.guard(i).branch(viewOf(beyond));
    if (branch == Guard::kOnEdge || branch == side) continue;
    crossing_.guard = i;
    crossing_.side = side;
    return true;
  }
  return false;
}

Integrator::Look Integrator::shortOfEnd(double taken, double* next) {
  const double margin = kMargin * taken + 2.0 * shortestStep(absolute(base_.time));
  *next = taken - margin;
  crossing_.at = base_.time + *next;
  crossing_.length = 2.0 * margin;
  return Look::kShorter;
}

Integrator::Look Integrator::lookAtEnd(double taken, double* next) {
  if (!front_.x.isFinite()) return Look::kClear;
  system_(front_.x, front_.dxdt, front_.time);
  if (!guards_.hasAnyLeft(viewOf(front_))) return Look::kClear;
  // The cubic through both ends tells about where.
  curve_.begin(absolute(base_.time), taken, S, integrates_torque_);
  for (int n = 0; n < StepCurve::kNodes; ++n) {
    const double part = StepCurve::node(n);
    const double rest = 1.0 - part;
    State x(system_.size());
    for (int m = 0; m < x.size(); ++m) {
      const double change = front_.x[m] - base_.x[m];
      const double bend =
          rest * (taken * base_.dxdt[m] - change) - part * (taken * front_.dxdt[m] - change);
      x[m] = base_.x[m] + part * (change + rest * bend);
    }
    curve_.setNode(n, x.data());
  }
  curve_.finish();
  const double refused = *next;
  const Look look = aimAtEdge(taken, next, false);
  if (look != Look::kShorter || *next <= 0.9 * taken) return look;
  *next = refused;
  return Look::kClear;
}

Integrator::Look Integrator::aimAtEdge(double taken, double* next, bool may_cross) {
  const double shortest = 2.0 * shortestStep(absolute(base_.time));
  const double resolution = std::max(kEdgeResolution, shortest / taken);
  const GuardFinding finding = guards_.find(curve_, resolution);
  if (finding.kind == GuardFinding::Kind::kClear) return keepCrossing();
  crossing_ = Crossing{};
  if (finding.kind == GuardFinding::Kind::kUnknown) {
    *next = taken * std::max(finding.clear, 0.1);
    return Look::kShorter;
  }
  // The step ends a little before the edge, for no stage to lie behind it.
  const double margin = kMargin * taken + shortest;
  crossing_.guard = finding.guard;
  crossing_.side = guards_.side(finding.guard);
  crossing_.length = (finding.beyond - finding.clear) * taken + margin + shortest;
  *next = finding.clear * taken - margin;
  if (*next > margin) {
    crossing_.at = base_.time + *next;
    return Look::kShorter;
  }
  crossing_.at = base_.time;
  crossing_.length += *next;
  if (may_cross && crossEdge()) {
    course_ = Course::kHop;
    return Look::kCrossed;
  }
  // It is not there: the curve of so long a step is no good.
  crossing_ = Crossing{};
  *next = 0.25 * taken;
  return Look::kShorter;
}

Integrator::Look Integrator::keepCrossing() {
  if (!crossing_.isDueAt(front_.time)) crossing_ = Crossing{};
  return Look::kClear;
}

void Integrator::traceStep(double taken) {
  curve_.begin(absolute(base_.time), taken, S, integrates_torque_);
  for (int n = 0; n < StepCurve::kNodes; ++n) {
    const double time = base_.time + StepCurve::node(n) * taken;
    State x(system_.size());
    if (n == 0) {
      x = base_.x;
    } else if (n + 1 == StepCurve::kNodes) {
      x = front_.x;
    } else if (!stepper_->hasDenseOutput() ||
               !stepper_->interpolate(system_, time, base_, front_, x)) {
      State unused(system_.size());
      choice_.innerOf(*stepper_).step(system_, base_, time - base_.time, x, unused);
    }
    curve_.setNode(n, x.data());
  }
  curve_.finish();
}

void Integrator::meetEdgeAtStart() {
  for (int i = 0; i < guards_.count(); ++i) {
    if (guards_.side(i) != Guard::kOnEdge || !guards_.guard(i).jumps()) continue;
    crossing_.guard = i;
    crossing_.side = guards_.side(i);
    crossing_.at = front_.time;
    crossing_.length = 2.0 * shortestStep(std::max(1.0, std::abs(absolute(front_.time))));
    return;
  }
}

bool Integrator::leaveCorner() {
  if (integrates_torque_) {
    for (const Constraint* kink : drivetrain_.kinks()) {
      double G[kMaxShafts];
      const StateView state = viewOf(front_);
      const double g = kink->calcResidualAndJacobian(state, G);
      double size = 0.0;
      for (int i = 0; i < S; ++i) size += std::abs(G[i]) * (1.0 + std::abs(state.acceleration[i]));
      if (!(std::abs(g) <= kCorner * size)) continue;
      bool is_still = true;
      for (int n = 2 * S; n < front_.dxdt.size(); ++n) {
        is_still = is_still && front_.dxdt[n] == 0.0;
      }
      if (is_still) continue;
      int leading = 0;
      StepNode best = front_;
      for (const double side : {1.0, -1.0}) {
        StepNode beside = front_;
        if (moveAside(*kink, G, side * 10.0 * kCorner * size, beside)) {
          best = beside;
          ++leading;
        }
      }
      if (leading == 1) {
        front_ = best;
        base_ = front_;
        moveGuards();
        continue;
      }
      stop(StopReason::kChattering);
      for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
        for (const ConstraintPtr& own : drivetrain_.constraint(m).kinks()) {
          if (own.get() == kink) status_.constraint = m;
        }
      }
      return false;
    }
  }
  return true;
}

bool Integrator::moveAside(const Constraint& kink, const double* G, double distance,
                           StepNode& node) {
  double direction[kMaxShafts];
  drivetrain_.inertia().solve(G, direction);
  double slope = 0.0;
  for (int i = 0; i < S; ++i) slope += G[i] * direction[i];
  if (!(slope > 0.0)) return false;
  double* acceleration = node.x.data() + node.x.size() - S;
  for (int i = 0; i < S; ++i) acceleration[i] += distance / slope * direction[i];
  State moved(system_.size());
  if (system_.project(node.time, node.x, moved, &statistics_.projections) !=
      ProjectionResult::kConverged) {
    return false;
  }
  system_(node.x, node.dxdt, node.time);
  double row[kMaxShafts];
  double rate;
  const StateView state = viewOf(node);
  if (!(kink.calcResidual(state) * distance > 0.0)) return false;
  kink.calcRow(state, row, &rate);
  for (int i = 0; i < S; ++i) rate += row[i] * node.dxdt[node.dxdt.size() - S + i];
  return rate * distance > 0.0;
}

State Integrator::goAhead(const StepNode& from, double length) const {
  State x = from.x;
  for (int n = 0; n < x.size(); ++n) {
    double change = from.dxdt[n];
    if (n + S < x.size()) change += 0.5 * length * from.dxdt[n + S];
    if (n + 2 * S < x.size()) change += length * length / 6.0 * from.dxdt[n + 2 * S];
    x[n] += length * change;
  }
  return x;
}

bool Integrator::crossEdge() {
  constexpr int kAttempts = 2;
  constexpr int kMostAttempts = 25;
  constexpr int kHalvings = 60;
  constexpr double kDepth = 1e-5;
  constexpr double kShyOfIt = 0.999;
  const int guard = crossing_.guard;
  // The step before may have ended a little beyond it, by the error of its dense output.
  if (guards_.side(guard) != crossing_.side) return false;
  int branch = Guard::kOnEdge;
  // Accelerations that the principle gives are known at a state, not along a series. They may go
  // on in the corner that an edge is for them (least_reaction.h).
  const int owner = drivetrain_.guardOwner(guard).constraint;
  const bool follows =
      !integrates_torque_ && owner >= 0 && drivetrain_.constraint(owner).order() == 2;
  const auto isBeyond = [&](double length) {
    front_.time = base_.time + length;
    front_.x = goAhead(base_, length);
    if (follows) {
      system_(front_.x, front_.dxdt, front_.time);
      if (system_.isInCorner()) return true;
    } else if (!integrates_torque_) {
      front_.dxdt = base_.dxdt;
    }
    branch = guards_.guard(guard).branch(viewOf(front_));
    return branch != Guard::kOnEdge && branch != guards_.side(guard);
  };
  double beyond = crossing_.length;
  int attempt = 0;
  while (!isBeyond(beyond) && ++attempt < (follows ? kMostAttempts : kAttempts) &&
         (!follows || isSeriesGood(beyond))) {
    beyond *= 4.0;
  }
  if (!isBeyond(beyond) || base_.time + beyond >= drivetrain_.inputSegmentEnd()) {
    front_ = base_;
    return false;
  }
  double before = 0.0;
  for (int halving = 0; halving < kHalvings; ++halving) {
    const double middle = 0.5 * (before + beyond);
    if (!(middle > before && middle < beyond)) break;
    (isBeyond(middle) ? beyond : before) = middle;
  }
  if (before > 0.0 && !isSeriesGood(kShyOfIt * before)) {
    front_ = base_;
    return false;
  }
  const double depth = kDepth * beyond + 2.0 * shortestStep(absolute(base_.time));
  const double reached = isBeyond(beyond + depth) ? beyond + depth : beyond;
  // A kink bends the accelerations. Where they jump, the least reaction that they followed has
  // ended there, and the next one is another motion's: as at a fold of a smooth psi.
  if (follows && haveAccelerationsJumped(isBeyond, before, reached)) {
    front_ = base_;
    stop(StopReason::kProjectionFailed);
    return false;
  }
  isBeyond(reached);
  return enterBranch(reached - beyond) && noteCrossing(guard, branch, depth);
}

bool Integrator::isSeriesGood(double length) {
  const double time = base_.time + length;
  const State x = goAhead(base_, length);
  double before[kMaxShafts];
  double after[kMaxShafts];
  if (integrates_torque_) {
    drivetrain_.calcTorque(system_.view(base_.time, base_.x), before);
    drivetrain_.calcTorque(system_.view(time, x), after);
    for (int i = 0; i < S; ++i) before[i] += length * base_.torque_rate[i];
    for (int i = 0; i < S; ++i)
      after[i] = (after[i] - before[i]) / drivetrain_.inertia().entry(i, i);
  } else {
    State dxdt(system_.size());
    system_(x, dxdt, time);
    for (int i = 0; i < S; ++i) after[i] = 0.5 * (dxdt[S + i] - base_.dxdt[S + i]);
  }
  double largest = 0.0;
  for (int i = 0; i < S; ++i) {
    largest = worseOf(largest, length * std::abs(after[i]) / tolerance_.of(x[S + i]));
  }
  if (integrates_torque_ && drivetrain_.hasOrder3()) {
    // Jerks that are given have nothing that would bring the accelerations back afterwards.
    State dxdt(system_.size());
    system_(x, dxdt, time);
    for (int n = 2 * S; n < x.size(); ++n) {
      const double error = 0.5 * length * std::abs(dxdt[n] - base_.dxdt[n]);
      largest = worseOf(largest, error / tolerance_.of(x[n]));
    }
  }
  return largest <= 1.0;
}

bool Integrator::crossJumpAhead(double reach) {
  StepNode ahead = base_;
  ahead.time += reach;
  ahead.x = goAhead(base_, reach);
  for (int i = 0; i < guards_.count(); ++i) {
    if (!guards_.guard(i).jumps() || !guards_.hasLeft(i, viewOf(ahead))) continue;
    crossing_.guard = i;
    crossing_.side = guards_.side(i);
    crossing_.at = base_.time;
    crossing_.length = reach;
    if (crossEdge()) return true;
    if (!status_.ok()) return false;
  }
  crossing_ = Crossing{};
  front_ = base_;
  return false;
}

bool Integrator::enterBranch(double late) {
  // What may jump there: a torque or the constraint itself, by `sign`, and the accelerations that
  // f' = 0 asks for, by a kink of f.
  bool jumps = false;
  bool kinks_velocity_row = false;
  int jumping_row = -1;
  const StateView there = viewOf(front_);
  for (int i = 0; i < guards_.count(); ++i) {
    const int branch = guards_.guard(i).branch(there);
    if (branch == Guard::kOnEdge || branch == guards_.side(i)) continue;
    const int row = drivetrain_.guardOwner(i).constraint;
    const bool jumps_here = guards_.guard(i).jumps();
    if (row < 0) {
      jumps = jumps || jumps_here;
    } else {
      const int order = drivetrain_.constraint(row).order();
      kinks_velocity_row = kinks_velocity_row || order == 1;
      if (jumps_here && order < 3) jumping_row = row;
    }
  }
  if (kinks_velocity_row && !system_.crossKink(base_, front_)) return refuseEdge();
  State moved(system_.size());
  const ProjectionResult projected =
      system_.project(front_.time, front_.x, moved, &statistics_.projections);
  if (projected != ProjectionResult::kConverged) return refuseEdge();
  if (kinks_velocity_row && integrates_torque_) {
    for (int n = 2 * S; n < moved.size(); ++n) moved[n] = 0.0;
  }
  const double displaced = calcErrorNorm(moved, base_.x, front_.x, tolerance_);
  if (jumping_row >= 0 && !(displaced <= 1.0)) {
    front_ = base_;
    stop(StopReason::kJumpFailed);
    status_.constraint = jumping_row;
    return false;
  }
  if (!jumpOverEdge(late)) return false;
  checks_.noteTorque(front_);
  system_.restoreReaction(front_, kAnyway);
  system_(front_.x, front_.dxdt, front_.time);
  noteDerivative();
  if (!front_.dxdt.isFinite()) return refuseEdge();
  if (kinks_velocity_row || jumps) choice_.restart();
  rows_.noteAnew();
  if (!finishStep()) return refuseEdge();
  checks_.noteTorque(front_);
  moveGuards();
  ++statistics_.steps;
  ++statistics_.kinks;
  crossing_ = Crossing{};
  return true;
}

bool Integrator::refuseEdge() {
  front_ = base_;
  return false;
}

bool Integrator::jumpOverEdge(double late) {
  if (integrates_torque_) {
    const double length = front_.time - base_.time;
    double before[kMaxShafts];
    double torque_jump[kMaxShafts];
    bool is_any = false;
    drivetrain_.calcTorque(system_.view(base_.time, base_.x), before);
    drivetrain_.calcTorque(system_.view(front_.time, front_.x), torque_jump);
    for (int i = 0; i < S; ++i) {
      torque_jump[i] -= before[i] + length * base_.torque_rate[i];
      is_any = is_any || std::abs(torque_jump[i]) > 1e-15 * std::abs(before[i]);
    }
    if (!is_any) return true;
    State x = front_.x;
    const MotionStatus result =
        system_.jumpTorque(front_.time, x, torque_jump, &statistics_.projections);
    if (!result.ok()) {
      front_ = base_;
      status_ = result;
      status_.time = absolute(front_.time);
      return false;
    }
    // It jumped at the edge itself, and the velocities have changed since.
    for (int i = 0; i < S; ++i) {
      const double change = x[2 * S + i] - front_.x[2 * S + i];
      x[S + i] += late * change;
      x[i] += 0.5 * late * late * change;
    }
    front_.x = x;
    State moved(system_.size());
    if (system_.project(front_.time, front_.x, moved, &statistics_.projections) !=
        ProjectionResult::kConverged) {
      return refuseEdge();
    }
  }
  return true;
}

bool Integrator::noteCrossing(int guard, int branch, double depth) {
  const bool jumps = guards_.guard(guard).jumps();
  const double now = absolute(front_.time);
  const bool at_once = guard == last_crossing_.guard &&
                       now - last_crossing_.time <= kAtOnce * (depth + last_crossing_.depth);
  last_crossing_ = {guard, now, depth, at_once ? last_crossing_.count + 1 : 0};
  if (!jumps && !integrates_torque_ && last_crossing_.count >= kMostTouches) {
    // Accelerations of least reaction may go on in the corner itself (least_reaction.h).
    guards_.mute(guard);
    return true;
  }
  bool turns_back = last_crossing_.count >= (jumps ? 1 : kMostTouches);
  if (jumps && !turns_back) {
    StepNode ahead = front_;
    ahead.time += 4.0 * depth;
    ahead.x = goAhead(front_, 4.0 * depth);
    const int next = guards_.guard(guard).branch(viewOf(ahead));
    turns_back = next != branch && next != Guard::kOnEdge;
  }
  if (!turns_back) return true;
  front_ = base_;
  stop(StopReason::kChattering);
  status_.torque = drivetrain_.guardOwner(guard).torque;
  status_.constraint = drivetrain_.guardOwner(guard).constraint;
  return false;
}

}  // namespace variator_sim
