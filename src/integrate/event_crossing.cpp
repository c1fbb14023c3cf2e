#include "integrate/event_crossing.h"

#include <algorithm>
#include <cmath>

namespace variator_sim {

void EventCrossing::reset() {
  next_ = NextEvent{};
  last_ = LastEvent{};
  guards_.reset();
}

void EventCrossing::restart() {
  absent_.guard = -1;
  next_ = NextEvent{};
  is_end_on_event_ = false;
}

void EventCrossing::forgetNext(bool was_due) {
  if (was_due) {
    step_.next_length = std::min(step_.next_length, next_.otherwise);
    absent_ = {next_.guard, start_.time};
  }
  // (The accelerations that a psi gives may have leapt to behind one of its own.)
  const bool is_false =
      was_due && next_.is_guess && drivetrain_.guardOwner(next_.guard).torque >= 0;
  if (is_false) ++last_.false_guesses;
  next_ = NextEvent{};
}

void EventCrossing::updateBranches() {
  const StateView state = step_.viewOf(end_);
  guards_.moveBase(state);
  if (!step_.is_in_corner) return;
  for (int i = 0; i < guards_.count(); ++i) {
    if (drivetrain_.guardOwner(i).constraint >= 0) guards_.muteOnEdge(i, state, S);
  }
}

int EventCrossing::findJumpNear() {
  system_(end_.x, end_.dxdt, end_.time);
  for (int i = 0; i < guards_.count(); ++i) {
    if (guards_.guard(i).jumps() && guards_.isNear(i, step_.viewOf(end_), S)) return i;
  }
  return -1;
}

bool EventCrossing::cross() {
  if (!stepAcross()) return false;
  step_.phase = StepPhase::kCrossing;
  return true;
}

bool EventCrossing::isBeyond(Bracket& event, double length) {
  end_.time = start_.time + length;
  end_.x = step_.extrapolate(start_, length);
  if (event.follows) {
    system_(end_.x, end_.dxdt, end_.time);
    if (system_.isInCorner()) return true;
  } else if (!integrates_torque_) {
    end_.dxdt = start_.dxdt;
  }
  event.branch = guards_.guard(event.guard).branch(step_.viewOf(end_));
  if (event.begins_on_event && guards_.isNear(event.guard, step_.viewOf(end_), S)) return false;
  return (event.branch != Guard::kOnEdge || event.settles) && event.branch != next_.side;
}

bool EventCrossing::findBeyond(Bracket& event, double resolution) {
  constexpr int kAttempts = 2;
  constexpr int kMostAttempts = 25;
  const bool searches = event.follows || event.begins_on_event ||
                        guards_.isNear(event.guard, step_.viewOf(start_), S);
  // No farther than where an input's closed form ends, but for rounding.
  event.most = drivetrain_.inputSegmentEnd() - start_.time + resolution;
  event.beyond = std::min(next_.length, event.most);
  int attempt = 0;
  while (!isBeyond(event, event.beyond) && event.beyond < event.most &&
         ++attempt < (searches ? kMostAttempts : kAttempts) &&
         (!searches || isSeriesGood(event.beyond))) {
    event.beyond = std::min(4.0 * event.beyond, event.most);
  }
  return isBeyond(event, event.beyond);
}

void EventCrossing::narrow(Bracket& event, double resolution) {
  constexpr int kMany = 60;
  for (int n = 0; n < kMany || event.beyond - event.before > resolution; ++n) {
    const double middle = 0.5 * (event.before + event.beyond);
    if (!(middle > event.before && middle < event.beyond)) break;
    (isBeyond(event, middle) ? event.beyond : event.before) = middle;
  }
}

bool EventCrossing::haveAccelerationsJumped(Bracket& event, double beyond) {
  constexpr double kJump = 1e-5;
  isBeyond(event, event.before);
  const State first = end_.dxdt;
  isBeyond(event, beyond);
  for (int n = first.size() - S; n < first.size(); ++n) {
    const double size = 1.0 + std::abs(first[n]);
    if (!(std::abs(end_.dxdt[n] - first[n]) <= kJump * size)) return true;
  }
  return false;
}

bool EventCrossing::stepAcross() {
  constexpr double kDepth = 1e-5;
  constexpr double kShyOfIt = 0.999;
  const int guard = next_.guard;
  // The step before may have ended a little beyond it, by the error of its dense output.
  const bool begins_on_event = next_.side == Guard::kOnEdge;
  if (!begins_on_event && guards_.side(guard) != next_.side) return false;
  const int owner = drivetrain_.guardOwner(guard).constraint;
  Bracket event{guard, begins_on_event,
                !integrates_torque_ && owner >= 0 && drivetrain_.constraint(owner).order() == 2};
  const double resolution = 2.0 * shortestStep(step_.absolute(start_.time));
  if (!findBeyond(event, resolution)) {
    if (event.beyond == event.most) return goToSegmentEnd();
    event.settles = event.branch == Guard::kOnEdge && guards_.guard(guard).jumps();
    if (!isBeyond(event, event.beyond)) {
      end_ = start_;
      return false;
    }
  }
  narrow(event, resolution);
  // (A rounding before the event the torque may be that behind it.)
  const double shy_of_it = std::min(kShyOfIt * event.before, event.before - resolution);
  if (shy_of_it > 0.0 && !isSeriesGoodUpTo(shy_of_it)) {
    end_ = start_;
    return false;
  }
  const double beyond = event.beyond;
  const double depth =
      std::min(begins_on_event ? next_.length : kDepth * beyond + resolution, event.most - beyond);
  const double reached =
      isBeyond(event, beyond + depth) ? leaveRounding(guard, beyond, depth, event.most) : beyond;
  // A kink bends the accelerations. Where they jump, the least reaction that they followed has
  // ended there, and the next one is another motion's: as at a fold of a smooth psi.
  if (event.follows && haveAccelerationsJumped(event, reached)) {
    end_ = start_;
    step_.stop(StopReason::kProjectionFailed);
    return false;
  }
  isBeyond(event, reached);
  return enterBranch(reached - beyond) &&
         noteCrossing(guard, event.branch, std::max(depth, reached - beyond),
                      start_.time + beyond - depth);
}

double EventCrossing::leaveRounding(int guard, double beyond, double depth, double most) {
  const double reached = beyond + depth;
  double length = reached;
  while (length <= most) {
    if (length > reached && !isSeriesGood(length)) break;
    end_.time = start_.time + length;
    end_.x = step_.extrapolate(start_, length);
    if (!guards_.isNear(guard, step_.viewOf(end_), S)) return length;
    if (!(depth > 0.0)) break;
    depth *= 4.0;
    length = beyond + depth;
  }
  return reached;
}

bool EventCrossing::goToSegmentEnd() {
  const double length = drivetrain_.inputSegmentEnd() - start_.time;
  const double shy_of_it = 0.999 * length;
  next_ = NextEvent{};
  if (!isSeriesGoodUpTo(shy_of_it)) {
    end_ = start_;
    return false;
  }
  drivetrain_.calcTorque(system_.view(start_.time, start_.x), end_.torque.data());
  for (int i = 0; i < S; ++i) end_.torque[i] += length * start_.torque_rate[i];
  end_.time = drivetrain_.inputSegmentEnd();
  end_.x = step_.extrapolate(start_, length);
  end_.dxdt = start_.dxdt;
  State moved(system_.size());
  if (system_.project(end_.time, end_.x, moved, &step_.statistics.projections) !=
      ProjectionResult::kConverged) {
    return reject();
  }
  is_end_on_event_ = true;
  ++step_.statistics.steps;
  return true;
}

bool EventCrossing::isSeriesGoodUpTo(double length) {
  for (const double part : {1.0, 0.5, 0.236, 0.764}) {
    if (!isSeriesGood(part * length)) return false;
  }
  return true;
}

bool EventCrossing::isSeriesGood(double length) {
  const double time = start_.time + length;
  const State x = step_.extrapolate(start_, length);
  double before[kMaxShafts];
  double after[kMaxShafts];
  if (integrates_torque_) {
    drivetrain_.calcTorque(system_.view(start_.time, start_.x), before);
    drivetrain_.calcTorque(system_.view(time, x), after);
    for (int i = 0; i < S; ++i) before[i] += length * start_.torque_rate[i];
    for (int i = 0; i < S; ++i)
      after[i] = (after[i] - before[i]) / drivetrain_.inertia().entry(i, i);
  } else {
    State dxdt(system_.size());
    system_(x, dxdt, time);
    for (int i = 0; i < S; ++i) after[i] = 0.5 * (dxdt[S + i] - start_.dxdt[S + i]);
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
      const double error = 0.5 * length * std::abs(dxdt[n] - start_.dxdt[n]);
      largest = worseOf(largest, error / tolerance_.of(x[n]));
    }
  }
  return largest <= 1.0;
}

bool EventCrossing::crossJumpAhead() {
  // A part of the longest step: every attempt feels a jump that is so near.
  constexpr double kReach = 1e-4;
  if (!guards_.hasJumps()) return false;
  const double reach = kReach * step_.settings.maximum_step;
  StepNode ahead = start_;
  ahead.time += reach;
  ahead.x = step_.extrapolate(start_, reach);
  for (int i = 0; i < guards_.count(); ++i) {
    const int side = guards_.side(i);
    if (!guards_.guard(i).jumps() || side == Guard::kOnEdge) continue;
    if (guards_.guard(i).branch(step_.viewOf(ahead)) == side) continue;
    next_.guard = i;
    next_.side = side;
    next_.at = start_.time;
    next_.length = reach;
    if (cross()) return true;
    if (!step_.status.ok()) return false;
  }
  next_ = NextEvent{};
  end_ = start_;
  return false;
}

EventCrossing::Change EventCrossing::findChange() {
  Change change;
  const StateView there = step_.viewOf(end_);
  for (int i = 0; i < guards_.count(); ++i) {
    const int branch = guards_.guard(i).branch(there);
    const bool jumps_here = guards_.guard(i).jumps();
    if (branch == guards_.side(i) || (branch == Guard::kOnEdge && !jumps_here)) continue;
    const int row = drivetrain_.guardOwner(i).constraint;
    if (row < 0) {
      change.torque_jumps = change.torque_jumps || jumps_here;
    } else {
      const int order = drivetrain_.constraint(row).order();
      change.kinks_velocity_row = change.kinks_velocity_row || order == 1;
      if (jumps_here && order < 3) change.jumping_row = row;
    }
  }
  return change;
}

bool EventCrossing::projectBehind(const Change& change) {
  if (change.kinks_velocity_row && !system_.crossKink(start_, end_)) return reject();
  State moved(system_.size());
  const ProjectionResult projected =
      system_.project(end_.time, end_.x, moved, &step_.statistics.projections);
  if (projected != ProjectionResult::kConverged) return reject();
  if (change.kinks_velocity_row && integrates_torque_) {
    for (int n = 2 * S; n < moved.size(); ++n) moved[n] = 0.0;
  }
  const double displaced = calcErrorNorm(moved, start_.x, end_.x, tolerance_);
  if (change.jumping_row < 0 || displaced <= 1.0) return true;
  end_ = start_;
  step_.stop(StopReason::kJumpFailed);
  step_.status.constraint = change.jumping_row;
  return false;
}

bool EventCrossing::enterBranch(double late) {
  const Change change = findChange();
  if (!projectBehind(change)) return false;
  if ((integrates_torque_ || change.torque_jumps) && !jumpTorque(late)) return false;
  step_.checks.noteTorque(end_);
  // However far: a torque has just changed its branch, and so must the reaction's drift.
  system_.reaction().correct(end_, std::numeric_limits<double>::infinity());
  if (integrates_torque_ || !change.torque_jumps) {
    system_(end_.x, end_.dxdt, end_.time);
  } else if (!differentiateBehind(late)) {
    return reject();
  }
  step_.noteDerivative();
  if (!end_.dxdt.isFinite()) return reject();
  if (change.kinks_velocity_row || change.torque_jumps) step_.choice.restart();
  step_.rows.noteAnew();
  if (!step_.checkEnd()) return reject();
  step_.checks.noteTorque(end_);
  updateBranches();
  ++step_.statistics.steps;
  ++step_.statistics.kinks;
  next_ = NextEvent{};
  return true;
}

bool EventCrossing::reject() {
  end_ = start_;
  system_.noteBase(start_.time, start_.x, start_.dxdt);  // a jump may have gone elsewhere
  return false;
}

bool EventCrossing::jumpTorque(double late) {
  const double length = end_.time - start_.time;
  double before[kMaxShafts];
  drivetrain_.calcTorque(system_.view(start_.time, start_.x), before);
  for (int i = 0; i < S; ++i) before[i] += length * start_.torque_rate[i];
  const State x = end_.x;
  if (!jumpFrom(before)) {
    reject();
    step_.status.time = step_.absolute(end_.time);
    return false;
  }
  if (!integrates_torque_) return true;
  double change[kMaxShafts];
  for (int i = 0; i < S; ++i) change[i] = end_.x[2 * S + i] - x[2 * S + i];
  return catchUp(change, late) || reject();
}

bool EventCrossing::jumpFrom(const double* before) {
  double torque_jump[kMaxShafts];
  bool is_any = false;
  drivetrain_.calcTorque(system_.view(end_.time, end_.x), torque_jump);
  for (int i = 0; i < S; ++i) {
    torque_jump[i] -= before[i];
    is_any = is_any || std::abs(torque_jump[i]) > 1e-15 * std::abs(before[i]);
  }
  if (!is_any) return true;
  State x = end_.x;
  const MotionStatus result =
      jump_map_.applyTorque(end_.time, x, torque_jump, &step_.statistics.projections);
  if (!acceptJump(result)) return false;
  end_.x = x;
  return true;
}

bool EventCrossing::acceptJump(const MotionStatus& result) {
  if (result.ok()) return true;
  step_.status = result;
  step_.status.time = step_.absolute(end_.time);
  return false;
}

bool EventCrossing::finishEnd() {
  const bool is_on_event = is_end_on_event_;
  is_end_on_event_ = false;
  return !is_on_event || jumpFrom(end_.torque.data());
}

bool EventCrossing::jumpInputs(const double* u0) {
  ++step_.statistics.jumps;
  drivetrain_.refreshInputs(end_.time);
  double u1[kMaxInputs];
  std::copy_n(drivetrain_.inputs(), drivetrain_.inputCount(), u1);
  return acceptJump(jump_map_.apply(end_.time, end_.x, u0, u1, &step_.statistics.projections));
}

bool EventCrossing::catchUp(const double* change, double late) {
  const StepNode there = end_;
  for (int i = 0; i < S; ++i) {
    end_.x[S + i] += late * change[i];
    end_.x[i] += 0.5 * late * late * change[i];
  }
  State moved(system_.size());
  if (system_.project(end_.time, end_.x, moved, &step_.statistics.projections) !=
      ProjectionResult::kConverged) {
    return false;
  }
  // If the torque throws the motion back over the event, noteCrossing needs the node beyond it.
  for (int i = 0; i < guards_.count(); ++i) {
    const int branch = guards_.guard(i).branch(step_.viewOf(there));
    if (guards_.guard(i).branch(step_.viewOf(end_)) != branch) end_ = there;
  }
  return true;
}

bool EventCrossing::differentiateBehind(double late) {
  system_(end_.x, end_.dxdt, end_.time);
  double change[kMaxShafts];
  for (int i = 0; i < S; ++i) change[i] = end_.dxdt[S + i] - start_.dxdt[S + i];
  if (!catchUp(change, late)) return false;
  system_(end_.x, end_.dxdt, end_.time);
  return true;
}

void EventCrossing::returnTo(double time) {
  StepNode event = start_;
  event.time = time;
  end_ = start_;
  if (!(time > start_.time)) return;
  event.x = step_.extrapolate(start_, time - start_.time);
  State moved(system_.size());
  const ProjectionResult projected =
      system_.project(time, event.x, moved, &step_.statistics.projections);
  if (projected != ProjectionResult::kConverged) return;
  system_(event.x, event.dxdt, time);
  if (event.dxdt.isFinite()) start_ = end_ = event;
}

bool EventCrossing::noteCrossing(int guard, int branch, double depth, double event) {
  // An event is crossed back at once when that takes so many times what going beyond it took.
  constexpr double kAtOnce = 100.0;
  // A kink that is crossed so often at once is not merely touched.
  constexpr int kMaxTouches = 10;
  const bool jumps = guards_.guard(guard).jumps();
  const double now = step_.absolute(end_.time);
  const bool at_once = guard == last_.guard && now - last_.time <= kAtOnce * (depth + last_.depth);
  // An event that is crossed again the same way was cut short by a command, and not crossed back.
  const int turns = branch != last_.branch ? 1 : 0;
  last_ = {guard, branch, now, depth, at_once ? last_.count + turns : 0};
  if (!jumps && !integrates_torque_ && last_.count >= kMaxTouches) {
    // Accelerations of least reaction may go on in the corner itself (least_reaction.h).
    guards_.mute(guard);
    return true;
  }
  bool turns_back = last_.count >= (jumps ? 1 : kMaxTouches);
  if (jumps && !turns_back) {
    // (A switching function that passes slowly has its rounding for so many roundings of time.)
    const double beyond = std::max(4.0 * depth, 1e3 * shortestStep(now));
    StepNode ahead = end_;
    ahead.time += beyond;
    ahead.x = step_.extrapolate(end_, beyond);
    const int next = guards_.guard(guard).branch(step_.viewOf(ahead));
    turns_back = next != branch && next != Guard::kOnEdge;
  }
  if (!turns_back) return true;
  returnTo(event);
  step_.stopChattering(guard);
  return false;
}

}  // namespace variator_sim
