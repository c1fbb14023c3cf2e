#include "dynamics/acceleration_system.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace variator_sim {

ProjectionResult AccelerationSystem::project(double t, State& x, State& moved,
                                             std::uint64_t* iterations) {
  moved.fill(0.0);
  const StateView state = view(t, x);
  const ProjectionResult result =
      projectVelocities(drivetrain_, state, x.data() + S, moved.data() + S, iterations);
  if (result != ProjectionResult::kConverged) return result;
  return projectAccelerations(drivetrain_, state, x.data() + 2 * S, moved.data() + 2 * S,
                              iterations);
}

ProjectionResult AccelerationSystem::projectStiffly(double t, double h, const State& /*slope*/,
                                                    State& x, State& moved,
                                                    std::uint64_t* iterations) {
  if (drivetrain_.hasVelocityRows() || !drivetrain_.hasAccelerationRows()) {
    return project(t, x, moved, iterations);
  }
  moved.fill(0.0);
  const StateView state = view(t, x);
  return iterateProjection(
      2 * S, [&](double* delta) { return drivetrain_.calcStiffProjection(state, h, delta); },
      x.data() + S, moved.data() + S, iterations);
}

InitialResult AccelerationSystem::start(State& x, double* nearest, bool* velocities_at_fault) {
  const InitialConditions& initial = scene_.initial;
  x.fill(0.0);
  std::copy(initial.angle.begin(), initial.angle.end(), x.begin());
  std::copy(initial.velocity.begin(), initial.velocity.end(), x.begin() + S);
  std::copy(initial.acceleration.begin(), initial.acceleration.end(), x.begin() + 2 * S);
  const StateView state = view(0.0, x);
  double* epsilon = x.data() + 2 * S;
  const InitialResult velocities =
      initial_solver_.acceptVelocities(state, initial.project, x.data() + S, nearest);
  *velocities_at_fault = velocities != InitialResult::kConsistent;
  if (*velocities_at_fault) return velocities;
  if (initial.acceleration.empty()) return initial_solver_.findLeastReaction(state, epsilon);
  return initial_solver_.acceptAccelerations(state, initial.project, epsilon, nearest);
}

InitialResult AccelerationSystem::accept(double t, bool may_move, bool are_given, State& x,
                                         double* epsilon, double* nearest,
                                         bool* velocities_at_fault) {
  const StateView state = view(t, x);
  const InitialResult velocities =
      initial_solver_.acceptVelocities(state, may_move, x.data() + S, nearest);
  *velocities_at_fault = velocities != InitialResult::kConsistent;
  if (*velocities_at_fault) return velocities;
  double* const own = x.data() + 2 * S;
  const InitialResult result =
      are_given ? initial_solver_.acceptAccelerations(state, may_move, own, nearest)
                : initial_solver_.findLeastReaction(state, own);
  std::copy_n(own, S, epsilon);
  return result;
}

bool AccelerationSystem::crossKink(const StepNode& from, StepNode& to) {
  double change[kMaxShafts];
  State there = to.x;
  std::copy_n(from.x.begin() + 2 * S, S, there.begin() + 2 * S);
  if (!drivetrain_.calcKinkJump(view(from.time, from.x), view(to.time, there), change)) {
    return false;
  }
  for (int i = 0; i < S; ++i) to.x[2 * S + i] += change[i];
  return true;
}

void AccelerationSystem::noteReaction(const StepNode& node) {
  const Inertia& inertia = drivetrain_.inertia();
  drivetrain_.calcReaction(view(node.time, node.x), node.torque.data(), reaction_at_start_);
  has_neutral_ = !keeps_reaction_in_range_ && (inertia.isConstant() || inertia.isDiagonal());
  for (int i = 0; i < S && !inertia.isConstant(); ++i) {
    reaction_at_start_[i] /= std::sqrt(inertia.entry(i, i));
  }
  for (int i = 0; i < S; ++i) is_neutral_[i] = !drivetrain_.readsColumn(i);
}

KeptReaction AccelerationSystem::keptReaction() const {
  KeptReaction kept;
  kept.exists = has_neutral_;
  std::copy_n(is_neutral_, S, kept.is_free);
  std::copy_n(reaction_at_start_, S, kept.value);
  return kept;
}

void AccelerationSystem::keepReaction(const KeptReaction& kept) {
  has_neutral_ = kept.exists;
  std::copy_n(kept.is_free, S, is_neutral_);
  std::copy_n(kept.value, S, reaction_at_start_);
}

void AccelerationSystem::noteColumns(const double (*C)[kMaxShafts]) {
  if (!has_neutral_ || drivetrain_.hasConstantJacobian()) return;
  has_neutral_ = false;
  for (int i = 0; i < S; ++i) {
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      is_neutral_[i] = is_neutral_[i] && C[m][i] == 0.0;
    }
    has_neutral_ = has_neutral_ || is_neutral_[i];
  }
}

bool AccelerationSystem::answersSteeply(const StepNode& node) {
  double left[kMaxShafts];  // N m, remaining allowance
  for (int i = 0; i < S; ++i) {
    left[i] = drivetrain_.inertia().entry(i, i) * tolerance_.of(node.x[2 * S + i]);
  }
  const auto answers = [&](double time, const State& x) {
    double torque[kMaxShafts];
    drivetrain_.calcTorque(view(time, x), torque);
    for (int i = 0; i < S; ++i) {
      left[i] -= std::abs(torque[i] - node.torque[i]);
      if (!(left[i] >= 0.0)) return true;
    }
    return false;
  };
  bool is_steep = false;
  if (drivetrain_.torquesReadTime()) {
    constexpr double kUlps = 8.0 * std::numeric_limits<double>::epsilon();
    const double size = std::abs(node.time) + std::abs(drivetrain_.origin());
    is_steep = answers(node.time - kUlps * size, node.x);
  }
  State x = node.x;
  for (int n = drivetrain_.readsAngles() ? 0 : S; n < 2 * S && !is_steep; ++n) {
    x[n] += tolerance_.of(x[n]);
    is_steep = answers(node.time, x);
    x[n] = node.x[n];
  }
  view(node.time, node.x);  // brings J back
  return is_steep;
}

void AccelerationSystem::restoreReaction(StepNode& node, double most) {
  if (!has_neutral_) return;
  double lost[kMaxShafts];  // R less R at the start
  double change[kMaxShafts];
  const StateView state = view(node.time, node.x);
  drivetrain_.calcReaction(state, node.torque.data(), lost);
  const Inertia& inertia = drivetrain_.inertia();
  for (int i = 0; i < S; ++i) {
    lost[i] -=
        reaction_at_start_[i] * (inertia.isConstant() ? 1.0 : std::sqrt(inertia.entry(i, i)));
  }
  // J d_epsilon = C^T lambda - lost, C d_epsilon = 0.
  double lambda[kMaxRows] = {};
  if (drivetrain_.hasConstantJacobian()) {
    if (!drivetrain_.factorOnce(state)) return;
  } else {
    double unused[kMaxRows] = {};
    if (!drivetrain_.calcRows(state, unused)) return;
    for (int i = 0; i < S; ++i) lost[i] = is_neutral_[i] ? lost[i] : 0.0;
  }
  drivetrain_.calcOutOfRange(lost, lambda, change);
  double largest = 0.0;
  for (int i = 0; i < S; ++i) {
    largest = std::max(largest, std::abs(change[i]) / tolerance_.of(node.x[2 * S + i]));
  }
  const bool is_cut = largest > most && answersSteeply(node);
  const double part = is_cut ? most / largest : 1.0;
  for (int i = 0; i < S; ++i) node.x[2 * S + i] += part * change[i];
}

const double* AccelerationSystem::calcTorqueRate(double t, const State& x) {
  double rate[kMaxShafts];
  drivetrain_.calcTorqueRate(view(t, x), rate);
  return drivetrain_.torqueRate();
}

void AccelerationSystem::copyRates(const State& x, State& dxdt) const {
  // A loop keeps the copy of a few numbers from becoming a call of memmove.
  for (int n = 0; n < 2 * S; ++n) dxdt[n] = x[n + S];
}

void AccelerationSystem::copyState(double t, const State& x, Sample* sample) const {
  sample->time = t;
  std::copy(x.begin(), x.begin() + S, sample->angle);
  std::copy(x.begin() + S, x.begin() + 2 * S, sample->velocity);
  std::copy(x.begin() + 2 * S, x.end(), sample->acceleration);
}

void AccelerationSystem::calcResiduals(const StateView& state, const double* eta,
                                       Sample* sample) const {
  for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
    sample->residual[m] = drivetrain_.calcResidual(m, state, eta);
  }
}

}  // namespace variator_sim
