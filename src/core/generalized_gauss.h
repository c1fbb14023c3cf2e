/// The system of the generalized Gauss principle: x = (phi, omega, epsilon), x' = (omega, epsilon,
/// eta) with the jerk whose reaction changes least.
#pragma once

#include <array>

#include "drivetrain.h"
#include "initial_conditions.h"
#include "jump.h"
#include "projection.h"
#include "variator_sim/sample.h"

namespace variator_sim {

/// A system, as the motion (motion_of.h) asks for it: its state, its derivative, how the state is
/// projected, started, moved by a jump of the inputs, and sampled. All but `start` are [loop].
template <int S>
class GeneralizedGauss {
 public:
  static constexpr int kShafts = S;
  using State = std::array<double, 3 * S>;

  explicit GeneralizedGauss(const Scene& scene)
      : scene_(scene), drivetrain_(scene), initial_solver_(drivetrain_), jump_map_(drivetrain_) {}

  Drivetrain<S>& drivetrain() { return drivetrain_; }
  /// Squared length of row m of C, in the metric J^-1, at the last derivative taken.
  double rowLengthSquared(int m) const { return drivetrain_.solver().rowLengthSquared(m); }

  /// The view of (t, x); the accelerations are part of the state.
  StateView view(double t, const State& x) {
    return drivetrain_.view(t, x.data(), x.data() + S, x.data() + 2 * S);
  }

  /// x' at (t, x): the system as Boost.Odeint calls it. NaN where C has lost rank.
  void operator()(const State& x, State& dxdt, double t) {
    for (int i = 0; i < 2 * S; ++i) dxdt[i] = x[S + i];
    double Lambda[Drivetrain<S>::kMaxRows] = {};
    calcJerk(view(t, x), &dxdt[2 * S], Lambda);
  }

  /// eta and Lambda. False, and eta NaN, where C has lost rank.
  bool calcJerk(const StateView& state, double* eta, double* Lambda) {
    drivetrain_.countRightHandSide();
    // -g = Q' - J' omega epsilon - n' + Gamma R omega [6]; for constant J it is Q'
    double rate[S];
    drivetrain_.calcFreeTorqueRate(state, rate);
    if (!drivetrain_.inertia().isConstant()) {
      double torque[S];
      double reaction[S];
      double connection[S];
      drivetrain_.calcTorque(state, torque);
      drivetrain_.calcReaction(state, torque, reaction);
      drivetrain_.calcConnection(state, reaction, connection);
      for (int i = 0; i < S; ++i) rate[i] += connection[i];
    }
    drivetrain_.inertia().solve(rate, eta);
    if (drivetrain_.constraintCount() == 0) return true;
    double c0[Drivetrain<S>::kMaxRows] = {};
    if (!drivetrain_.calcRows(state, c0)) {
      for (int i = 0; i < S; ++i) eta[i] = std::numeric_limits<double>::quiet_NaN();
      return false;
    }
    drivetrain_.solver().constrain(c0, eta, Lambda);
    return true;
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

  /// The state at time 0 with the inputs as they are. `nearest` gets the nearest consistent
  /// accelerations, or velocities where the result says so (S values).
  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) {
    x.fill(0.0);
    std::copy(scene_.initial.angle.begin(), scene_.initial.angle.end(), x.begin());
    std::copy(scene_.initial.velocity.begin(), scene_.initial.velocity.end(), x.begin() + S);
    const bool given = !scene_.initial.acceleration.empty();
    if (given) {
      std::copy(scene_.initial.acceleration.begin(), scene_.initial.acceleration.end(),
                x.begin() + 2 * S);
    }
    const StateView state = view(0.0, x);
    double* omega = x.data() + S;
    double* epsilon = x.data() + 2 * S;
    const InitialResult velocities =
        initial_solver_.acceptVelocities(state, scene_.initial.project, omega, nearest);
    *velocities_at_fault = velocities != InitialResult::kConsistent;
    if (*velocities_at_fault) return velocities;
    return given ? initial_solver_.acceptAccelerations(state, scene_.initial.project, epsilon,
                                                       nearest)
                 : initial_solver_.findLeastReaction(state, epsilon);
  }

  /// What a jump of the inputs from u0 to u1 at t does to x. On failure x is unchanged.
  MotionStatus jump(double t, State& x, const double* u0, const double* u1,
                    std::uint64_t* projections) {
    view(t, x);  // brings J to phi
    return jump_map_.apply(t, x.data(), x.data() + S, u0, u1, scene_.solver, x.data() + 2 * S,
                           projections);
  }

  /// A step begins at (t, x), where the derivative is dxdt: what iterations may start from.
  void noteBase(double /*t*/, const State& /*x*/, const State& /*dxdt*/) {}

  /// Everything that is published, at (t, x). False where C has lost rank.
  bool calcSample(double t, const State& x, Sample* sample) {
    const StateView state = view(t, x);
    sample->time = t;
    std::copy(x.begin(), x.begin() + S, sample->angle);
    std::copy(x.begin() + S, x.begin() + 2 * S, sample->velocity);
    std::copy(x.begin() + 2 * S, x.end(), sample->acceleration);
    // R = J epsilon + n - Q
    drivetrain_.calcTorque(state, sample->applied_torque);
    drivetrain_.calcReaction(state, sample->applied_torque, sample->reaction_torque);
    double eta[S];
    const bool regular = calcJerk(state, eta, sample->multiplier);
    // R' = C^T Lambda + Gamma R omega [6]
    double* rate = sample->reaction_torque_rate;
    std::fill(rate, rate + S, 0.0);
    if (!drivetrain_.inertia().isConstant()) {
      drivetrain_.calcConnection(state, sample->reaction_torque, rate);
    }
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      const double* C = drivetrain_.solver().row(m);
      for (int i = 0; i < S; ++i) rate[i] += C[i] * sample->multiplier[m];
      sample->residual[m] = drivetrain_.calcResidual(m, state, eta);
    }
    return regular;
  }

 private:
  const Scene& scene_;
  Drivetrain<S> drivetrain_;
  InitialConditionSolver<S> initial_solver_;
  JumpMap<S> jump_map_;
};

}  // namespace variator_sim
