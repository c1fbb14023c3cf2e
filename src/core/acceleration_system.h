/// What the systems share whose state has accelerations: x = (phi, omega, epsilon).
#pragma once

#include <algorithm>
#include <array>

#include "drivetrain.h"
#include "guard_search.h"
#include "initial_conditions.h"
#include "jump.h"
#include "linearization.h"
#include "projection.h"
#include "variator_sim/sample.h"

namespace variator_sim {

/// A system, as the motion (motion_of.h) asks for it: its state, its derivative, how the state is
/// projected, started, moved by a jump of the inputs, and sampled. The derivative and the sample
/// are the derived classes'. All but `start` are [loop].
template <class Shape>
class AccelerationSystem {
 public:
  static constexpr int kShafts = Shape::kShafts;
  static constexpr int S = kShafts;
  using DrivetrainType = Drivetrain<Shape>;
  static constexpr int kMaxRows = DrivetrainType::kMaxRows;
  /// True when the number of constraints is known when compiled.
  static constexpr bool kHasRows = Shape::kRows != kAnyRows;
  static constexpr bool kIntegratesTorque = true;
  using State = std::array<double, 3 * S>;
  using LinearizationType = Linearization<S, 3>;

  Drivetrain<Shape>& drivetrain() { return drivetrain_; }
  const LeastReactionSearch<Shape>& search() const { return initial_solver_.search(); }
  bool readsAngles() const { return drivetrain_.readsAngles(); }
  bool readsTime() const { return drivetrain_.readsTime(); }
  /// Squared length of row m of C, in the metric J^-1, at the last derivative taken.
  double rowLengthSquared(int m) const { return drivetrain_.solver().rowLengthSquared(m); }
  /// Row m of C there, S values.
  const double* row(int m) const { return drivetrain_.solver().row(m); }

  /// The view of (t, x); the accelerations are part of the state.
  StateView view(double t, const State& x) {
    return drivetrain_.view(t, x.data(), x.data() + S, x.data() + 2 * S);
  }

  /// Projects x, which stands at t, onto the constraints; `moved` gets by how much.
  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations) {
    moved.fill(0.0);
    const StateView state = view(t, x);
    const ProjectionResult result =
        projectVelocities(drivetrain_, state, x.data() + S, moved.data() + S, iterations);
    if (result != ProjectionResult::kConverged) return result;
    return projectAccelerations(drivetrain_, state, x.data() + 2 * S, moved.data() + 2 * S,
                                iterations);
  }

  /// The same for a state that an implicit step of size h has reached: see calcStiffProjection.
  ProjectionResult projectStiffly(double t, double h, const State& /*slope*/, State& x,
                                  State& moved, std::uint64_t* iterations) {
    if (drivetrain_.hasVelocityRows() || !drivetrain_.hasAccelerationRows()) {
      return project(t, x, moved, iterations);
    }
    moved.fill(0.0);
    const StateView state = view(t, x);
    return iterateProjection<2 * S>(
        [&](double* delta) { return drivetrain_.calcStiffProjection(state, h, delta); },
        x.data() + S, moved.data() + S, iterations);
  }

  /// The state at time 0 with the inputs as they are. `nearest` gets the nearest consistent
  /// accelerations, or velocities where the result says so (S values).
  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) {
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

  /// What a jump of the inputs from u0 to u1 at t does to x. On failure x is unchanged.
  MotionStatus jump(double t, State& x, const double* u0, const double* u1,
                    std::uint64_t* projections) {
    const StateView state = view(t, x);  // brings J to phi
    return jump_map_.apply(state.time, x.data(), x.data() + S, u0, u1, x.data() + 2 * S,
                           projections);
  }
  /// What a jump of the applied torque by `torque_jump` (N m, S values) at t does to x.
  MotionStatus jumpTorque(double t, State& x, const double* torque_jump,
                          std::uint64_t* projections) {
    const StateView state = view(t, x);
    return jump_map_.applyTorque(state.time, x.data(), x.data() + S, torque_jump, x.data() + 2 * S,
                                 projections);
  }

  /// Constraints of order 1 have a kink between two nodes that are next to nothing apart: moves the
  /// accelerations at `to`, which are those at `from`, as f' = 0 asks. False where C loses rank.
  template <class Node>
  bool crossKink(const Node& from, Node& to) {
    double change[S];
    State there = to.x;
    std::copy_n(from.x.begin() + 2 * S, S, there.begin() + 2 * S);
    if (!drivetrain_.calcKinkJump(view(from.time, from.x), view(to.time, there), change)) {
      return false;
    }
    for (int i = 0; i < S; ++i) to.x[2 * S + i] += change[i];
    return true;
  }

  /// (Accelerations that are integrated do not stay in a corner of psi.)
  bool isInCorner() const { return false; }

  /// (The rate of a torque that jumps is the same on both sides: no stage can go wrong by it.)
  void watch(JumpWatch* /*watch*/) {}

  /// R' = C^T Lambda: what no C has ever had a part of is a constant of the reaction R, and not the
  /// integrator's business. It is kept as it is at the start: `noteReaction` there (and wherever a
  /// motion begins), `noteColumns` after every derivative at the end of a step.
  template <class Node>
  void noteReaction(const Node& node) {
    drivetrain_.calcReaction(view(node.time, node.x), node.torque.data(), reaction_at_start_);
    has_neutral_ = !keeps_reaction_in_range_;
    for (int i = 0; i < S; ++i) is_neutral_[i] = !drivetrain_.readsColumn(i);
    noteColumns();
  }
  void noteColumns() {
    if (!has_neutral_ || drivetrain_.hasConstantJacobian()) return;
    has_neutral_ = false;
    for (int i = 0; i < S; ++i) {
      for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
        is_neutral_[i] = is_neutral_[i] && row(m)[i] == 0.0;
      }
      has_neutral_ = has_neutral_ || is_neutral_[i];
    }
  }
  /// Moves the accelerations of a node, whose torque is known, to where that part of the reaction
  /// is what it was, along psi = 0, by `most` tolerances. False when there was nothing to do.
  template <class Node>
  bool restoreReaction(Node& node, double most) {
    if (!has_neutral_) return false;
    double lost[S];  // R less R at the start
    double change[S];
    const StateView state = view(node.time, node.x);
    drivetrain_.calcReaction(state, node.torque.data(), lost);
    for (int i = 0; i < S; ++i) lost[i] -= reaction_at_start_[i];
    // J d_epsilon = C^T lambda - lost, C d_epsilon = 0.
    double lambda[kMaxRows] = {};
    if (drivetrain_.hasConstantJacobian()) {
      if (!drivetrain_.factorOnce(state)) return false;
    } else {
      double unused[kMaxRows] = {};
      if (!drivetrain_.calcRows(state, unused)) return false;
      for (int i = 0; i < S; ++i) lost[i] = is_neutral_[i] ? lost[i] : 0.0;
    }
    drivetrain_.calcOutOfRange(lost, lambda, change);
    double largest = 0.0;
    for (std::size_t i = 0; i < S; ++i) {
      largest = std::max(largest, std::abs(change[i]) / tolerance_.of(node.x[2 * S + i]));
    }
    const double part = largest > most ? most / largest : 1.0;
    for (int i = 0; i < S; ++i) node.x[2 * S + i] += part * change[i];
    return true;
  }

  /// Q' at the last derivative taken, N m/s, S values.
  const double* torqueRate() const { return drivetrain_.torqueRate(); }
  /// Q' at (t, x), where x need not satisfy the constraints.
  const double* calcTorqueRate(double t, const State& x) {
    double rate[S];
    drivetrain_.calcTorqueRate(view(t, x), rate);
    return drivetrain_.torqueRate();
  }

  /// A step begins at (t, x), where the derivative is dxdt: what iterations may start from.
  void noteBase(double /*t*/, const State& /*x*/, const State& /*dxdt*/) {}

 protected:
  AccelerationSystem(const Scene& scene, bool keeps_reaction_in_range)
      : scene_(scene),
        tolerance_{scene.solver.absolute_tolerance, scene.solver.relative_tolerance},
        drivetrain_(scene),
        initial_solver_(drivetrain_),
        jump_map_(drivetrain_, scene.solver, keeps_reaction_in_range),
        keeps_reaction_in_range_(keeps_reaction_in_range) {}

  /// phi' = omega, omega' = epsilon.
  static void copyRates(const State& x, State& dxdt) {
    // A loop, for the copy of a few numbers not to become a call of memmove.
    for (std::size_t n = 0; n < 2 * S; ++n) dxdt[n] = x[n + S];
  }
  static void copyState(double t, const State& x, Sample* sample) {
    sample->time = t;
    std::copy(x.begin(), x.begin() + S, sample->angle);
    std::copy(x.begin() + S, x.begin() + 2 * S, sample->velocity);
    std::copy(x.begin() + 2 * S, x.end(), sample->acceleration);
  }
  void calcResiduals(const StateView& state, const double* eta, Sample* sample) const {
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      sample->residual[m] = drivetrain_.calcResidual(m, state, eta);
    }
  }

  const Scene& scene_;
  Tolerance tolerance_;
  Drivetrain<Shape> drivetrain_;
  InitialConditionSolver<Shape> initial_solver_;
  JumpMap<Shape> jump_map_;
  bool keeps_reaction_in_range_;
  bool has_neutral_ = false;
  bool is_neutral_[S] = {};
  double reaction_at_start_[S] = {};
};

}  // namespace variator_sim
