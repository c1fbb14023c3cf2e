/// Where a law changes its branch inside a step: the step is to end shortly before.
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
  guards_.ignoreNone();
  is_still_ = isStill(box);
  if (endsOnEdge(taken)) return shortOfEnd(taken, next);
  if (guards_.isClear(box)) return keepCrossing();
  traceStep(taken);
  return aimAtEdge(taken, next);
}

bool Integrator::isStill(const StateBox& box) const {
  const auto moves = [this](const Interval& range) {
    return !(range.high - range.low <= tolerance_.of(range.low, range.high));
  };
  for (int i = 0; i < S; ++i) {
    if (moves(box.angle[i]) || moves(box.velocity[i]) || moves(box.acceleration[i])) return false;
  }
  return true;
}

bool Integrator::isHarmless(int guard, const StateView& beyond) {
  if (!is_still_ || guards_.guard(guard).readsTime() || drivetrain_.guardOwner(guard).torque < 0) {
    return false;
  }
  double before[kMaxShafts];
  double behind[kMaxShafts];
  const StateView here = viewOf(base_);
  drivetrain_.calcTorque(here, before);
  drivetrain_.calcTorque(beyond, behind);
  for (int i = 0; i < S; ++i) {
    const double allowed = drivetrain_.inertia().entry(i, i) * tolerance_.of(here.acceleration[i]);
    if (!(std::abs(behind[i] - before[i]) <= allowed)) return false;
  }
  return true;
}

bool Integrator::isEdgeOfTime(double taken) {
  if (!integrates_torque_) return false;
  StateBox box;
  encloseStep(S, curveEnd(base_), curveEnd(front_), taken, &box);
  box.time = {absolute(base_.time), absolute(base_.time)};
  return guards_.isClear(box);
}

int Integrator::nearJump() {
  system_(front_.x, front_.dxdt, front_.time);
  for (int i = 0; i < guards_.count(); ++i) {
    if (guards_.guard(i).jumps() && guards_.isNear(i, viewOf(front_), S)) return i;
  }
  return -1;
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
    if (branch == Guard::kOnEdge || branch == side || isHarmless(i, viewOf(beyond))) continue;
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
  guards_.ignoreNone();
  is_still_ = false;
  if (endsOnEdge(taken)) return shortOfEnd(taken, next);
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
  const Look look = aimAtEdge(taken, next);
  if (look != Look::kShorter || *next <= 0.9 * taken) {
    crossing_.is_guess = look == Look::kShorter;
    return look;
  }
  *next = refused;
  return Look::kClear;
}

Integrator::Look Integrator::aimAtEdge(double taken, double* next) {
  const double shortest = 2.0 * shortestStep(absolute(base_.time));
  const double resolution = std::max(kEdgeResolution, shortest / taken);
  GuardFinding finding = guards_.find(curve_, resolution);
  while (finding.kind == GuardFinding::Kind::kCrossing &&
         isHarmless(finding.guard, guards_.at(curve_, finding.beyond))) {
    guards_.ignore(finding.guard);
    finding = guards_.find(curve_, resolution);
  }
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
  if (crossEdge()) {
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

void Integrator::forgetCrossing(bool was_due) {
  if (was_due) next_step_ = std::min(next_step_, crossing_.otherwise);
  // (The accelerations that a psi gives may have leapt to behind one of its own.)
  const bool is_false =
      was_due && crossing_.is_guess && drivetrain_.guardOwner(crossing_.guard).torque >= 0;
  if (is_false) ++last_crossing_.false_guesses;
  crossing_ = Crossing{};
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
    } else if (!stepper_->interpolate(system_, time, base_, front_, x)) {
      choice_.innerOf(*stepper_).step(system_, base_, time - base_.time, x);
    }
    curve_.setNode(n, x.data());
  }
  curve_.finish();
}

void Integrator::meetEdgeAtStart() {
  for (int i = 0; i < guards_.count(); ++i) {
    if (!guards_.guard(i).jumps()) continue;
    if (guards_.side(i) != Guard::kOnEdge && !guards_.isNear(i, viewOf(front_), S)) continue;
    crossing_.guard = i;
    crossing_.side = Guard::kOnEdge;
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

}  // namespace variator_sim
