/// The systems of the classical Gauss principle: the reaction itself is least, R = C^T lambda.
///
/// Up to order 2 the accelerations follow from t, phi and omega, so the state is x = (phi, omega)
/// and no torque is asked for its rate, but where R' is published. With a constraint of order 3 the
/// same condition is equation [18]: its derivative gives the jerk, and x = (phi, omega, epsilon).
#pragma once

#include <array>

#include "acceleration_system.h"
#include "drivetrain.h"
#include "guard_search.h"
#include "initial_conditions.h"
#include "linearization.h"
#include "projection.h"
#include "variator_sim/sample.h"

namespace variator_sim {

/// Constraints of order 1 and 2. See AccelerationSystem for what each method means.
template <class Shape>
class ClassicalGauss {
 public:
  static constexpr int kShafts = Shape::kShafts;
  static constexpr int S = kShafts;
  using DrivetrainType = Drivetrain<Shape>;
  static constexpr int kMaxRows = DrivetrainType::kMaxRows;
  /// True when the number of constraints is known when compiled.
  static constexpr bool kHasRows = Shape::kRows != kAnyRows;
  using State = std::array<double, 2 * S>;
  using LinearizationType = Linearization<S, 2>;

  explicit ClassicalGauss(const Scene& scene)
      : scene_(scene), drivetrain_(scene), initial_solver_(drivetrain_) {
    for (const ConstraintPtr& constraint : scene.constraints) {
      linear_ = linear_ && constraint->nonlinearAccelerations() == 0;
    }
  }

  Drivetrain<Shape>& drivetrain() { return drivetrain_; }
  const LeastReactionSearch<Shape>& search() const { return initial_solver_.search(); }
  bool readsAngles() const { return drivetrain_.readsAngles(); }
  bool readsTime() const { return drivetrain_.readsTime(); }
  double rowLengthSquared(int m) const { return drivetrain_.accelerationRowLengthSquared(m); }
  const double* row(int m) const { return drivetrain_.accelerationRow(m); }

  /// The view of (t, x) with the accelerations that the principle gives there.
  StateView view(double t, const State& x) {
    const StateView state = drivetrain_.view(t, x.data(), x.data() + S, epsilon_);
    calcAccelerations(state);
    return state;
  }

  [[gnu::noinline]] void operator()(const State& x, State& dxdt, double t) {
    drivetrain_.countRightHandSide();
    const StateView state = view(t, x);
    if (watch_ != nullptr) watch_->note(state);
    for (int i = 0; i < S; ++i) {
      dxdt[i] = x[S + i];
      dxdt[S + i] = epsilon_[i];
    }
  }

  void calcLinearization(double t, const State& x, LinearizationType& linearization) {
    linearizeByDifferences(*this, t, x, readsAngles(), drivetrain_.naturalSize(), linearization);
  }

  /// See Drivetrain::calcAccelerationResidual; only where psi is linear in the accelerations, so
  /// that its form does not depend on them.
  bool keepsConstraintsInStages() const {
    return linear_ && drivetrain_.canKeepConstraintsInStages();
  }
  /// What implicit steps solve: M x' - f = 0 in its last S rows, `rate` the last rows of x', the
  /// accelerations.
  void calcStageResidual(double t, const State& x, const double* rate,
                         const LinearizationType& linearization, double* residual) {
    if (keepsConstraintsInStages()) {
      drivetrain_.countRightHandSide();
      const StateView state = drivetrain_.view(t, x.data(), x.data() + S, rate);
      if (!drivetrain_.calcAccelerationResidual(state, linearization.projector(),
                                                linearization.pull(), residual)) {
        std::fill(residual, residual + S, std::numeric_limits<double>::quiet_NaN());
      }
      return;
    }
    State dxdt;
    (*this)(x, dxdt, t);
    for (std::size_t i = 0; i < S; ++i) residual[i] = rate[i] - dxdt[dxdt.size() - S + i];
  }
  /// Its derivatives at x, whose derivative is dxdt.
  void calcStageLinearization(double t, const State& x, const State& dxdt,
                              LinearizationType& linearization) {
    linearization.mass().setIdentity();
    if (!keepsConstraintsInStages()) {
      calcLinearization(t, x, linearization);
      return;
    }
    const StateView state = drivetrain_.view(t, x.data(), x.data() + S, dxdt.data() + S);
    double torque[S];
    double reaction[S];
    double c0[Drivetrain<Shape>::kMaxRows] = {};
    double lambda[Drivetrain<Shape>::kMaxRows] = {};
    drivetrain_.calcTorque(state, torque);
    drivetrain_.calcReaction(state, torque, reaction);
    if (drivetrain_.calcRows(state, c0)) drivetrain_.calcMultipliers(reaction, lambda);
    double derivatives[2 * S * S];
    drivetrain_.calcAccelerationDerivatives(state, lambda, linearization.projector(),
                                            linearization.pull(), derivatives);
    for (int i = 0; i < S; ++i) {
      for (int q = 0; q < 2 * S; ++q) {
        linearization.block(q / S)(i, q % S) = -derivatives[q * S + i];
      }
    }
  }

  /// The accelerations follow from the velocities, with 1/tau of a stiff constraint between them.
  /// An implicit step knows both, by its own `slope`: the velocities move by the little that makes
  /// psi = 0 with it.
  ProjectionResult projectStiffly(double t, double h, const State& slope, State& x, State& moved,
                                  std::uint64_t* iterations) {
    if (!keepsConstraintsInStages()) return project(t, x, moved, iterations);
    double both[2 * S];  // velocities, accelerations
    double change[2 * S] = {};
    for (int i = 0; i < S; ++i) {
      both[i] = x[S + i];
      both[S + i] = slope[S + i];
    }
    const StateView state = drivetrain_.view(t, x.data(), both, both + S);
    const ProjectionResult result = iterateProjection<2 * S>(
        [&](double* delta) { return drivetrain_.calcStiffProjection(state, h, delta); }, both,
        change, iterations);
    moved.fill(0.0);
    for (int i = 0; i < S; ++i) {
      x[S + i] = both[i];
      moved[S + i] = change[i];
    }
    return result;
  }
  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations) {
    moved.fill(0.0);
    if (!drivetrain_.hasVelocityRows()) return ProjectionResult::kConverged;
    const StateView state = drivetrain_.view(t, x.data(), x.data() + S, epsilon_);
    return projectVelocities(drivetrain_, state, x.data() + S, moved.data() + S, iterations);
  }

  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) {
    std::copy(scene_.initial.angle.begin(), scene_.initial.angle.end(), x.begin());
    std::copy(scene_.initial.velocity.begin(), scene_.initial.velocity.end(), x.begin() + S);
    const StateView state = drivetrain_.view(0.0, x.data(), x.data() + S, epsilon_);
    const InitialResult velocities =
        initial_solver_.acceptVelocities(state, scene_.initial.project, x.data() + S, nearest);
    *velocities_at_fault = velocities != InitialResult::kConsistent;
    if (*velocities_at_fault) return velocities;
    InitialResult result = initial_solver_.findLeastReaction(state, epsilon_);
    if (!scene_.initial.acceleration.empty() &&
        (result == InitialResult::kNotUnique || result == InitialResult::kDoubtful)) {
      // Those given choose among the stationary ones.
      std::copy_n(scene_.initial.acceleration.begin(), S, epsilon_);
      std::copy(epsilon_, epsilon_ + S, guess_);
      noteMultipliers(state);
      calcAccelerations(state);
      if (!std::isfinite(epsilon_[0])) return InitialResult::kNotFound;
      result = InitialResult::kConsistent;
    }
    std::copy(epsilon_, epsilon_ + S, guess_);
    std::copy(epsilon_, epsilon_ + S, nearest);
    noteMultipliers(state);
    if (result != InitialResult::kConsistent || scene_.initial.acceleration.empty() ||
        scene_.initial.project) {
      return result;
    }
    // The accelerations are no data here; given ones may only say what follows anyway.
    for (int i = 0; i < S; ++i) {
      const double given = scene_.initial.acceleration[i];
      if (std::abs(given - epsilon_[i]) > 1e-6 * std::max(1.0, std::abs(given))) {
        return InitialResult::kInconsistent;
      }
    }
    return result;
  }

  /// The accelerations follow from the inputs: simply solve again.
  MotionStatus jump(double t, State& x, const double* /*u0*/, const double* /*u1*/,
                    std::uint64_t* /*projections*/) {
    MotionStatus status;
    const StateView state = view(t, x);
    for (int i = 0; i < S; ++i) {
      if (std::isfinite(state.acceleration[i])) continue;
      status.reason = StopReason::kJumpFailed;
    }
    if (status.ok()) {
      std::copy(epsilon_, epsilon_ + S, guess_);
      noteMultipliers(state);
    }
    return status;
  }

  /// The accelerations follow from the state: there is nothing to move.
  template <class Node>
  bool crossKink(const Node& /*from*/, Node& /*to*/) {
    return true;
  }

  /// True where the last accelerations lie in a corner of psi.
  bool isInCorner() const { return corner_ != 0; }

  /// Tells `watch` of every state at which the derivative is taken.
  void watch(JumpWatch* watch) { watch_ = watch; }

  /// The reaction follows from the state: nothing of it can drift.
  template <class Node>
  void noteReaction(const Node& /*node*/) {}
  void noteColumns() {}
  template <class Node>
  bool restoreReaction(Node& /*node*/, double /*most*/) {
    return false;
  }

  /// Newton's iteration starts from the accelerations at the beginning of the step, whoever asks
  /// and in whatever order: samples may not change the motion.
  void noteBase(double t, const State& x, const State& dxdt) {
    if (linear_) return;
    std::copy(dxdt.begin() + S, dxdt.end(), guess_);
    noteMultipliers(drivetrain_.view(t, x.data(), x.data() + S, guess_));
  }

  bool calcSample(double t, const State& x, Sample* sample) {
    const StateView state = view(t, x);
    sample->time = t;
    std::copy(x.begin(), x.begin() + S, sample->angle);
    std::copy(x.begin() + S, x.end(), sample->velocity);
    std::copy(epsilon_, epsilon_ + S, sample->acceleration);
    // R = J epsilon + n - Q = C^T lambda
    drivetrain_.calcTorque(state, sample->applied_torque);
    drivetrain_.calcReaction(state, sample->applied_torque, sample->reaction_torque);
    std::fill(sample->reaction_torque_rate, sample->reaction_torque_rate + S, 0.0);
    if (drivetrain_.constraintCount() == 0) return true;
    double c0[Drivetrain<Shape>::kMaxRows] = {};
    if (!drivetrain_.calcRows(state, c0)) return false;
    drivetrain_.calcMultipliers(sample->reaction_torque, sample->multiplier);
    double eta[S];
    bool regular = true;
    if (corner_ == 0) {
      regular =
          drivetrain_.calcFormalJerk(state, sample->multiplier, eta, sample->reaction_torque_rate);
    } else {
      // In a corner of psi C is not one: the kinks that meet there have multipliers of their own.
      regular = initial_solver_.solver().calcJerk(state, corner_, multipliers_, eta,
                                                  sample->reaction_torque_rate);
      std::copy_n(multipliers_, drivetrain_.constraintCount(), sample->multiplier);
    }
    for (int m = 0; m < drivetrain_.constraintCount(); ++m) {
      sample->residual[m] = drivetrain_.calcResidual(m, state, eta);
    }
    return regular;
  }

 private:
  /// lambda_guess_ of the reaction at `state`.
  void noteMultipliers(const StateView& state) {
    double torque[S];
    double reaction[S];
    double c0[Drivetrain<Shape>::kMaxRows] = {};
    drivetrain_.calcTorque(state, torque);
    drivetrain_.calcReaction(state, torque, reaction);
    if (drivetrain_.calcRows(state, c0)) drivetrain_.calcMultipliers(reaction, lambda_guess_);
  }

  /// epsilon_ at `state`, whose accelerations point there; NaN where there are none.
  void calcAccelerations(const StateView& state) {
    double torque[S];
    drivetrain_.calcFreeTorque(state, torque);
    if (linear_) {
      // psi = C epsilon + b: with epsilon = 0 the projection's residual is b, and
      // A lambda = -(b + C epsilon_free) is one correction from the free accelerations.
      drivetrain_.inertia().solve(torque, epsilon_);
      if (drivetrain_.constraintCount() == 0) return;
      // (Nearly dependent rows take a few, as in ConstraintSolver::refine.)
      double delta[S];
      bool solved = drivetrain_.calcAccelerationProjection(state, delta);
      for (int i = 0; i < S && solved; ++i) epsilon_[i] += delta[i];
      for (int round = 0; round < 3 && solved && drivetrain_.areAccelerationRowsIll(); ++round) {
        solved = drivetrain_.calcAccelerationProjection(state, delta);
        for (int i = 0; i < S && solved; ++i) epsilon_[i] += delta[i];
      }
      if (solved) return;
    } else {
      // With the multipliers of the same place: from others the iteration may take another branch.
      std::copy(guess_, guess_ + S, epsilon_);
      std::fill_n(multipliers_, S, 0.0);
      std::copy_n(lambda_guess_, kMaxRows, multipliers_);
      if (initial_solver_.solver().continueFrom(state, torque, epsilon_, multipliers_, &corner_)) {
        return;
      }
    }
    std::fill(epsilon_, epsilon_ + S, std::numeric_limits<double>::quiet_NaN());
  }

  const Scene& scene_;
  Drivetrain<Shape> drivetrain_;
  JumpWatch* watch_ = nullptr;
  InitialConditionSolver<Shape> initial_solver_;
  bool linear_ = true;
  double epsilon_[S] = {};
  double guess_[S] = {};
  double lambda_guess_[Drivetrain<Shape>::kMaxRows] = {};
  double multipliers_[S] = {};  // at epsilon_, where psi is not linear
  unsigned corner_ = 0;         // the kinks on which epsilon_ lies
};

/// With constraints of order 3, equation [18]: J epsilon + n - Q = C^T lambda differentiated,
/// beside C eta + c0 = 0. The minimum of nothing, but what a user may want to compare.
template <class Shape>
class FormalGauss : public AccelerationSystem<Shape> {
  using Base = AccelerationSystem<Shape>;
  using Base::drivetrain_;
  using Base::S;
  using Base::scene_;

 public:
  using typename Base::State;

  explicit FormalGauss(const Scene& scene) : Base(scene, true) {}

  [[gnu::noinline]] void operator()(const State& x, State& dxdt, double t) {
    drivetrain_.countRightHandSide();
    this->copyRates(x, dxdt);
    double torque[S];
    double reaction[S];
    double lambda[Drivetrain<Shape>::kMaxRows] = {};
    double reaction_rate[S];
    calcJerk(this->view(t, x), torque, reaction, lambda, &dxdt[2 * S], reaction_rate);
  }

  void calcLinearization(double t, const State& x, Linearization<S, 3>& linearization) {
    linearizeByDifferences(*this, t, x, this->readsAngles(), drivetrain_.naturalSize(),
                           linearization);
  }

  bool keepsConstraintsInStages() const { return false; }
  /// What implicit steps solve: M x' - f = 0 in its last S rows, `rate` the last rows of x'; here
  /// x' itself.
  void calcStageResidual(double t, const State& x, const double* rate,
                         const Linearization<S, 3>& /*linearization*/, double* residual) {
    State dxdt;
    (*this)(x, dxdt, t);
    for (std::size_t i = 0; i < S; ++i) residual[i] = rate[i] - dxdt[dxdt.size() - S + i];
  }
  /// Its derivatives at x, whose derivative is dxdt.
  void calcStageLinearization(double t, const State& x, const State& /*dxdt*/,
                              Linearization<S, 3>& linearization) {
    linearization.mass().setIdentity();
    calcLinearization(t, x, linearization);
  }

  ProjectionResult projectStiffly(double t, double /*h*/, const State& /*slope*/, State& x,
                                  State& moved, std::uint64_t* iterations) {
    return project(t, x, moved, iterations);
  }
  /// Orders 1 and 2 as ever; then the reaction back into range(C^T), from which it drifts.
  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations) {
    const ProjectionResult result = Base::project(t, x, moved, iterations);
    if (result != ProjectionResult::kConverged) return result;
    const StateView state = this->view(t, x);
    double* epsilon = x.data() + 2 * S;
    if (!calcReactionInRange(state, epsilon, moved.data() + 2 * S)) {
      return ProjectionResult::kSingular;
    }
    return ProjectionResult::kConverged;
  }

  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) {
    const InitialResult result = Base::start(x, nearest, velocities_at_fault);
    if (result != InitialResult::kConsistent || scene_.initial.acceleration.empty()) return result;
    const StateView state = this->view(0.0, x);
    double* epsilon = x.data() + 2 * S;
    // The initial reaction must lie in range(C^T).
    double moved[S] = {};
    if (!calcReactionInRange(state, epsilon, moved)) return InitialResult::kSingular;
    std::copy(epsilon, epsilon + S, nearest);
    for (int i = 0; i < S; ++i) {
      if (!(moved[i] <= 1e-9 * std::max(1.0, std::abs(epsilon[i]))) && !scene_.initial.project) {
        return InitialResult::kInconsistent;
      }
    }
    return InitialResult::kConsistent;
  }

  bool calcSample(double t, const State& x, Sample* sample) {
    const StateView state = this->view(t, x);
    this->copyState(t, x, sample);
    double eta[S];
    const bool regular = calcJerk(state, sample->applied_torque, sample->reaction_torque,
                                  sample->multiplier, eta, sample->reaction_torque_rate);
    this->calcResiduals(state, eta, sample);
    return regular;
  }

 private:
  bool calcJerk(const StateView& state, double* torque, double* reaction, double* lambda,
                double* eta, double* reaction_rate) {
    drivetrain_.calcTorque(state, torque);
    drivetrain_.calcReaction(state, torque, reaction);
    double c0[Drivetrain<Shape>::kMaxRows] = {};
    if (drivetrain_.calcRows(state, c0)) {
      drivetrain_.calcMultipliers(reaction, lambda);
      if (drivetrain_.calcFormalJerk(state, lambda, eta, reaction_rate)) return true;
    }
    std::fill(eta, eta + S, std::numeric_limits<double>::quiet_NaN());
    return false;
  }

  /// epsilon = J^-1 (Q - n + C^T lambda) with the lambda of the part of R in range(C^T).
  bool calcReactionInRange(const StateView& state, double* epsilon, double* moved) {
    double torque[S];
    double reaction[S];
    double lambda[Drivetrain<Shape>::kMaxRows] = {};
    double c0[Drivetrain<Shape>::kMaxRows] = {};
    drivetrain_.calcTorque(state, torque);
    drivetrain_.calcReaction(state, torque, reaction);
    if (!drivetrain_.calcRows(state, c0)) return false;
    double rest[S];
    drivetrain_.calcOutOfRange(reaction, lambda, rest);
    for (int i = 0; i < S; ++i) {
      moved[i] += std::abs(rest[i]);
      epsilon[i] += rest[i];
    }
    return true;
  }
};

}  // namespace variator_sim
