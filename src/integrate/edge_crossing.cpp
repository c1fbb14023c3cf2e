/// Across an edge that a step has come to: by a series, to a little behind it.
#include <algorithm>
#include <cmath>

#include "integrate/integrator.h"

namespace variator_sim {

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

/// Halves until nothing lies between a length before the edge and one beyond it, or, by many
/// halvings, no more than `resolution`.
template <class IsBeyond>
static void narrow(const IsBeyond& is_beyond, double resolution, double* before, double* beyond) {
  constexpr int kMany = 60;
  for (int n = 0; n < kMany || *beyond - *before > resolution; ++n) {
    const double middle = 0.5 * (*before + *beyond);
    if (!(middle > *before && middle < *beyond)) break;
    *(is_beyond(middle) ? beyond : before) = middle;
  }
}

template <class Go>
bool Integrator::haveAccelerationsJumped(const Go& go, double before, double beyond) {
  constexpr double kJump = 1e-5;
  go(before);
  const State first = front_.dxdt;
  go(beyond);
  for (int n = first.size() - S; n < first.size(); ++n) {
    const double size = 1.0 + std::abs(first[n]);
    if (!(std::abs(front_.dxdt[n] - first[n]) <= kJump * size)) return true;
  }
  return false;
}

bool Integrator::crossEdge() {
  constexpr int kAttempts = 2;
  constexpr int kMostAttempts = 25;
  constexpr double kDepth = 1e-5;
  constexpr double kShyOfIt = 0.999;
  const int guard = crossing_.guard;
  // The step before may have ended a little beyond it, by the error of its dense output.
  // A motion that begins on the edge goes to the side on which it is beyond rounding.
  const bool begins_on_edge = crossing_.side == Guard::kOnEdge;
  if (!begins_on_edge && guards_.side(guard) != crossing_.side) return false;
  int branch = Guard::kOnEdge;
  bool settles = false;
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
    if (begins_on_edge && guards_.isNear(guard, viewOf(front_), S)) return false;
    return (branch != Guard::kOnEdge || settles) && branch != crossing_.side;
  };
  const bool searches = follows || begins_on_edge || guards_.isNear(guard, viewOf(base_), S);
  // No farther than where an input's closed form ends, but for rounding.
  const double resolution = 2.0 * shortestStep(absolute(base_.time));
  const double most = drivetrain_.inputSegmentEnd() - base_.time + resolution;
  double beyond = std::min(crossing_.length, most);
  int attempt = 0;
  while (!isBeyond(beyond) && beyond < most && ++attempt < (searches ? kMostAttempts : kAttempts) &&
         (!searches || isSeriesGood(beyond))) {
    beyond = std::min(4.0 * beyond, most);
  }
  if (!isBeyond(beyond) && beyond == most) return goToSegmentEnd();
  // An argument may come to its edge and stay there: a law that jumps has a value of its own then.
  settles = !isBeyond(beyond) && branch == Guard::kOnEdge && guards_.guard(guard).jumps();
  if (!isBeyond(beyond)) {
    front_ = base_;
    return false;
  }
  double before = 0.0;
  narrow(isBeyond, resolution, &before, &beyond);
  // (A rounding before the edge the torque may be that behind it.)
  const double shy_of_it = std::min(kShyOfIt * before, before - resolution);
  if (shy_of_it > 0.0 && !isSeriesGood(shy_of_it)) {
    front_ = base_;
    return false;
  }
  const double depth =
      std::min(begins_on_edge ? crossing_.length : kDepth * beyond + resolution, most - beyond);
  const double reached =
      isBeyond(beyond + depth) ? leaveRounding(guard, beyond, depth, most) : beyond;
  // A kink bends the accelerations. Where they jump, the least reaction that they followed has
  // ended there, and the next one is another motion's: as at a fold of a smooth psi.
  if (follows && haveAccelerationsJumped(isBeyond, before, reached)) {
    front_ = base_;
    stop(StopReason::kProjectionFailed);
    return false;
  }
  isBeyond(reached);
  const double edge = base_.time + beyond - depth;
  return enterBranch(reached - beyond) &&
         noteCrossing(guard, branch, std::max(depth, reached - beyond), edge);
}

double Integrator::leaveRounding(int guard, double beyond, double depth, double most) {
  const double reached = beyond + depth;
  double length = reached;
  while (length <= most) {
    if (length > reached && !isSeriesGood(length)) break;
    front_.time = base_.time + length;
    front_.x = goAhead(base_, length);
    if (!guards_.isNear(guard, viewOf(front_), S)) return length;
    if (!(depth > 0.0)) break;
    depth *= 4.0;
    length = beyond + depth;
  }
  return reached;
}

bool Integrator::goToSegmentEnd() {
  const double length = drivetrain_.inputSegmentEnd() - base_.time;
  const double shy_of_it = 0.999 * length;
  crossing_ = Crossing{};
  if (!isSeriesGood(shy_of_it)) {
    front_ = base_;
    return false;
  }
  drivetrain_.calcTorque(system_.view(base_.time, base_.x), front_.torque.data());
  for (int i = 0; i < S; ++i) front_.torque[i] += length * base_.torque_rate[i];
  front_.time = drivetrain_.inputSegmentEnd();
  front_.x = goAhead(base_, length);
  front_.dxdt = base_.dxdt;
  State moved(system_.size());
  if (system_.project(front_.time, front_.x, moved, &statistics_.projections) !=
      ProjectionResult::kConverged) {
    return refuseEdge();
  }
  is_end_on_edge_ = true;
  ++statistics_.steps;
  return true;
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
    const int side = guards_.side(i);
    if (!guards_.guard(i).jumps() || side == Guard::kOnEdge) continue;
    if (guards_.guard(i).branch(viewOf(ahead)) == side) continue;
    crossing_.guard = i;
    crossing_.side = side;
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
    const bool jumps_here = guards_.guard(i).jumps();
    if (branch == guards_.side(i) || (branch == Guard::kOnEdge && !jumps_here)) continue;
    const int row = drivetrain_.guardOwner(i).constraint;
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
  if ((integrates_torque_ || jumps) && !jumpOverEdge(late)) return false;
  checks_.noteTorque(front_);
  system_.restoreReaction(front_, kAnyway);
  if (integrates_torque_ || !jumps) {
    system_(front_.x, front_.dxdt, front_.time);
  } else if (!differentiateBehind(late)) {
    return refuseEdge();
  }
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
  system_.noteBase(base_.time, base_.x, base_.dxdt);  // a jump may have gone elsewhere
  return false;
}

bool Integrator::jumpOverEdge(double late) {
  const double length = front_.time - base_.time;
  double before[kMaxShafts];
  drivetrain_.calcTorque(system_.view(base_.time, base_.x), before);
  for (int i = 0; i < S; ++i) before[i] += length * base_.torque_rate[i];
  const State x = front_.x;
  if (!jumpFrom(before)) {
    refuseEdge();
    status_.time = absolute(front_.time);
    return false;
  }
  if (!integrates_torque_) return true;
  double change[kMaxShafts];
  for (int i = 0; i < S; ++i) change[i] = front_.x[2 * S + i] - x[2 * S + i];
  return catchUp(change, late) || refuseEdge();
}

bool Integrator::jumpFrom(const double* before) {
  double torque_jump[kMaxShafts];
  bool is_any = false;
  drivetrain_.calcTorque(system_.view(front_.time, front_.x), torque_jump);
  for (int i = 0; i < S; ++i) {
    torque_jump[i] -= before[i];
    is_any = is_any || std::abs(torque_jump[i]) > 1e-15 * std::abs(before[i]);
  }
  if (!is_any) return true;
  State x = front_.x;
  const MotionStatus result =
      jump_map_.applyTorque(front_.time, x, torque_jump, &statistics_.projections);
  if (result.ok()) {
    front_.x = x;
    return true;
  }
  status_ = result;
  status_.time = absolute(front_.time);
  return false;
}

bool Integrator::catchUp(const double* change, double late) {
  const StepNode there = front_;
  for (int i = 0; i < S; ++i) {
    front_.x[S + i] += late * change[i];
    front_.x[i] += 0.5 * late * late * change[i];
  }
  State moved(system_.size());
  if (system_.project(front_.time, front_.x, moved, &statistics_.projections) !=
      ProjectionResult::kConverged) {
    return false;
  }
  // Where the torque throws the motion back over the edge, noteCrossing is to see it beyond.
  for (int i = 0; i < guards_.count(); ++i) {
    const int branch = guards_.guard(i).branch(viewOf(there));
    if (guards_.guard(i).branch(viewOf(front_)) != branch) front_ = there;
  }
  return true;
}

bool Integrator::differentiateBehind(double late) {
  system_(front_.x, front_.dxdt, front_.time);
  double change[kMaxShafts];
  for (int i = 0; i < S; ++i) change[i] = front_.dxdt[S + i] - base_.dxdt[S + i];
  if (!catchUp(change, late)) return false;
  system_(front_.x, front_.dxdt, front_.time);
  return true;
}

void Integrator::goToEdge(double time) {
  StepNode edge = base_;
  edge.time = time;
  front_ = base_;
  if (!(time > base_.time)) return;
  edge.x = goAhead(base_, time - base_.time);
  State moved(system_.size());
  const ProjectionResult projected = system_.project(time, edge.x, moved, &statistics_.projections);
  if (projected != ProjectionResult::kConverged) return;
  system_(edge.x, edge.dxdt, time);
  if (edge.dxdt.isFinite()) base_ = front_ = edge;
}

bool Integrator::noteCrossing(int guard, int branch, double depth, double edge) {
  const bool jumps = guards_.guard(guard).jumps();
  const double now = absolute(front_.time);
  const bool at_once = guard == last_crossing_.guard &&
                       now - last_crossing_.time <= kAtOnce * (depth + last_crossing_.depth);
  // An edge that is crossed again the same way was cut short by a command, and not crossed back.
  const int turns = branch != last_crossing_.branch ? 1 : 0;
  last_crossing_ = {guard, branch, now, depth, at_once ? last_crossing_.count + turns : 0};
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
  goToEdge(edge);
  stopChattering(guard);
  return false;
}

}  // namespace variator_sim
