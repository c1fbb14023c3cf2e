/// The system of the classical Gauss principle up to order 2: the reaction itself is least,
/// R = C^T lambda. The accelerations follow from t, phi and omega, so the state is x = (phi, omega)
/// and no torque is asked for its rate, but where R' is published. (Order 3: formal_gauss.h.)
#pragma once

#include <utility>

#include "dynamics/principle_system.h"
#include "dynamics/projection.h"
#include "dynamics/torque_tangent.h"

namespace variator_sim {

/// Constraints of order 1 and 2. See AccelerationSystem for what each method means.
class ClassicalGauss final : public PrincipleSystem {
 public:
  explicit ClassicalGauss(const Scene& scene, const Shortcuts& shortcuts = {},
                          const PrincipleSystem* like = nullptr);

  double rowLengthSquared(int m) const override {
    return drivetrain_.accelerationRowLengthSquared(m);
  }
  const double* row(int m) const override { return drivetrain_.accelerationRow(m); }

  /// The view of (t, x) with the accelerations that the principle gives there.
  StateView view(double t, const State& x) override;

  void derive(const State& x, State& dxdt, double t);

  void calcLinearization(double t, const State& x, Linearization& linearization) override {
    const TorqueTangent tangent(drivetrain_, drivetrain_.view(t, x.data(), x.data() + S, epsilon_));
    tangent_ = &tangent;
    // Differences may look behind a jump; no stage has been there.
    StageWatch* const watch = std::exchange(watch_, nullptr);
    linearizeByDifferences(*this, t, x, readsAngles(), drivetrain_.naturalSize(), linearization);
    watch_ = watch;
    tangent_ = nullptr;
  }

  /// See Drivetrain::calcAccelerationResidual; only where psi is linear in the accelerations, so
  /// that its form does not depend on them.
  bool keepsConstraintsInStages() const override {
    return linear_ && drivetrain_.canKeepConstraintsInStages();
  }
  /// Computes the residual of an implicit stage: M x' - f in its last S rows, `rate` the last rows
  /// of x', the accelerations.
  void calcStageResidual(double t, const State& x, const double* rate,
                         const Linearization& linearization, double* residual) override;
  /// Its derivatives at x, whose derivative is dxdt.
  void calcStageLinearization(double t, const State& x, const State& dxdt,
                              Linearization& linearization) override;

  /// The accelerations follow from the velocities, with 1/tau of a stiff constraint between them.
  /// An implicit step knows both, by its own `slope`: the velocities move by the little that makes
  /// psi = 0 with it.
  ProjectionResult projectStiffly(double t, double h, const State& slope, State& x, State& moved,
                                  std::uint64_t* iterations) override;
  ProjectionResult project(double t, State& x, State& moved, std::uint64_t* iterations) override;

  InitialResult start(State& x, double* nearest, bool* velocities_at_fault) override;

  InitialResult accept(double t, bool may_move, bool are_given, State& x, double* epsilon,
                       double* nearest, bool* velocities_at_fault) override;

  /// The accelerations follow from the inputs and the torque. Where psi is linear in them they are
  /// simply solved for again; else there may be several stationary points, and the motion takes the
  /// one that ever faster ramps lead to.
  MotionStatus jump(double t, State& x, const double* u0, const double* u1,
                    std::uint64_t* projections) override;
  MotionStatus jumpTorque(double t, State& x, const double* torque_jump,
                          std::uint64_t* projections) override;

  /// In a corner of psi the motion is another one than that of its formula.
  MotionSeries* series() const override { return corner_ == 0 ? series_.get() : nullptr; }

  bool isInCorner() const override { return corner_ != 0; }

  void watch(StageWatch* watch) override { watch_ = watch; }

  /// Newton's iteration starts from the accelerations at the beginning of the step for every caller
  /// and in every order: samples may not change the motion.
  void noteBase(double t, const State& x, const State& dxdt) override;

  bool calcSample(double t, const State& x, Sample* sample) override;

 private:
  /// Whether given accelerations say what follows anyway.
  bool areNear(const double* given, const double* epsilon) const;

  /// lambda (k values) of the reaction at `state`; unchanged where C has lost rank.
  void calcMultipliers(const StateView& state, double* lambda);

  /// epsilon_ at `state`, whose accelerations point there; NaN where there are none.
  void calcAccelerations(const StateView& state);
  /// The same under `torque`, Q - n.
  void calcAccelerations(const StateView& state, const double* torque);

  /// Follows the stationary point along a jump; `move_to(part, torque)` brings `state` to that part
  /// of it and tells Q - n there. In steps so short that one of them leads where two halves do: a
  /// longer one may come to another branch, or to none. Fails where the branch ends.
  template <class MoveTo>
  MotionStatus follow(const StateView& state, MoveTo move_to);

  const TorqueTangent* tangent_ = nullptr;  // stands for Q while a linearization is made
  StageWatch* watch_ = nullptr;
  bool linear_ = true;
  double epsilon_[kMaxShafts] = {};
  double guess_[kMaxShafts] = {};
  double lambda_guess_[kMaxRows] = {};
  double multipliers_[kMaxShafts] = {};  // at epsilon_, where psi is not linear
  unsigned corner_ = 0;                  // the kinks on which epsilon_ lies
};

}  // namespace variator_sim
